#include "ParaView.h"

#include <gtest/gtest.h>

#include <vtkCellData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

vtkSmartPointer<vtkPolyData> read(const VtpText& file) {
  vtkNew<vtkXMLPolyDataReader> reader;
  const std::string text = file.text();
  reader->ReadFromInputStringOn();
  reader->SetInputString(text);
  reader->Update();
  EXPECT_EQ(reader->GetErrorCode(), 0u);
  return reader->GetOutput();
}

/// A thread and a capsule on a sheet, in contact with it.
class ParaView : public ::testing::Test {
 protected:
  ParaView() : world(1) {
    mesh = world.addMesh("sheet", sheet(8), 1);
    thread = world.addThread(
        "thread", std::vector<Vector3d>{{-0.3, 0.1, 0.02}, {0, 0.1, 0.03}, {0.4, 0.2, 0.02}}, 0.01,
        1);
    tool = world.addShape("tool", Sphere{Vector3d::Zero(), 0.1}, sphere(2));
    world.place(tool, Eigen::Matrix3d::Identity(), {0.5, -0.5, 0.12});
    for (const World::BodyId other : {thread, tool})
      world.addPair(mesh, other, {.method = Method::Proximity, .thickness = 0.05}, 0.05);
    world.predict(1, Vector3d::Zero(), 0);
    world.detect();
  }

  World world;
  World::BodyId mesh, thread, tool;
};

TEST_F(ParaView, ReadsBodies) {
  const vtkSmartPointer<vtkPolyData> data = read(bodiesVtp(world));
  const SceneMesh ball = sphere(2);
  ASSERT_EQ(data->GetNumberOfPoints(), static_cast<vtkIdType>(81 + 3 + ball.positions.size()));
  EXPECT_EQ(data->GetNumberOfPolys(), static_cast<vtkIdType>(128 + ball.triangles.size()));
  ASSERT_EQ(data->GetNumberOfLines(), 2);
  for (std::uint32_t i = 0; i < 84; ++i)
    EXPECT_EQ(Vector3d(data->GetPoint(i)), world.solver().now[i]) << i;
  EXPECT_EQ(Vector3d(data->GetPoint(84)), Vector3d(ball.positions[0] + Vector3d(0.5, -0.5, 0.12)));
  vtkDataArray* body = data->GetCellData()->GetArray("body");
  ASSERT_NE(body, nullptr);
  EXPECT_EQ(body->GetTuple1(0), static_cast<double>(thread));  // lines come first
  EXPECT_EQ(body->GetTuple1(2), static_cast<double>(mesh));
  EXPECT_EQ(body->GetTuple1(data->GetNumberOfCells() - 1), static_cast<double>(tool));
  const auto ids = data->GetCell(2 + 127)->GetPointIds();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(ids->GetId(i), world.bodies()[mesh].triangles[127][i]);
}

TEST_F(ParaView, ReadsContactsWithTheirFields) {
  const vtkSmartPointer<vtkPolyData> data = read(contactsVtp(world));
  const CollisionData &lines = world.contacts(mesh, thread), &ball = world.contacts(mesh, tool);
  const std::size_t count =
      lines.vertexTriangle().size() + lines.triangleVertex().size() + lines.edgeEdge().size();
  ASSERT_GT(count, 0u);
  ASSERT_GT(ball.shape().size(), 0u);
  ASSERT_EQ(data->GetNumberOfVerts(), static_cast<vtkIdType>(count + ball.shape().size()));
  vtkPointData* fields = data->GetPointData();
  for (const char* name : {"distance", "time of impact", "normal", "pair", "kind"})
    ASSERT_NE(fields->GetArray(name), nullptr) << name;
  const ShapeContact& contact = ball.shape().front();
  const auto at = static_cast<vtkIdType>(count);
  EXPECT_EQ(fields->GetArray("kind")->GetTuple1(at), 3);
  EXPECT_EQ(fields->GetArray("pair")->GetTuple1(at), 1);
  EXPECT_EQ(fields->GetArray("distance")->GetTuple1(at), contact.distance);
  EXPECT_EQ(Vector3d(fields->GetArray("normal")->GetTuple3(at)), contact.normal);
  EXPECT_EQ(Vector3d(data->GetPoint(at)), Vector3d((contact.point + contact.pointOnShape) / 2));
}

TEST_F(ParaView, ReadsOctreeCells) {
  const LooseOctree& octree = world.detection().octree();
  const vtkSmartPointer<vtkPolyData> data = read(octreeVtp(octree));
  std::vector<LooseOctree::Node> nodes;
  for (const GeometryId geometry : octree.geometries())
    for (const LooseOctree::Node& node : octree.nodes(geometry))
      if (!node.elements.empty()) nodes.push_back(node);
  ASSERT_EQ(data->GetNumberOfLines(), static_cast<vtkIdType>(12 * nodes.size()));
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    for (int line = 0; line < 12; ++line) {
      const auto cell = static_cast<vtkIdType>(12 * n + line);
      const auto ids = data->GetCell(cell)->GetPointIds();
      const Vector3d p(data->GetPoint(ids->GetId(0))), q(data->GetPoint(ids->GetId(1)));
      EXPECT_NEAR((p - q).lpNorm<1>(), nodes[n].bounds.sizes().x(), 1e-12);  // along an axis
      EXPECT_TRUE(nodes[n].bounds.contains(p) && nodes[n].bounds.contains(q));
      EXPECT_EQ(data->GetCellData()->GetArray("depth")->GetTuple1(cell), nodes[n].depth);
      EXPECT_EQ(data->GetCellData()->GetArray("elements")->GetTuple1(cell),
                static_cast<double>(nodes[n].elements.size()));
      EXPECT_EQ(data->GetCellData()->GetArray("geometry")->GetTuple1(cell),
                static_cast<double>(nodes[n].geometry));
    }
  }
}

}  // namespace
}  // namespace palpate::scenes
