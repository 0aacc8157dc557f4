#include <palpate/vtk/MeshFile.h>

#include <gtest/gtest.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPLYWriter.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataWriter.h>
#include <vtkSTLWriter.h>
#include <vtkXMLPolyDataWriter.h>

#include <filesystem>
#include <random>

namespace palpate::vtk {
namespace {

// Reads files of VTK's own writers, in every mode of these writers.
class WrittenByVtk : public ::testing::Test {
 protected:
  WrittenByVtk()
      : path(std::filesystem::path(::testing::TempDir()) /
             ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::mt19937 random(1);
    std::uniform_int_distribution<int> coordinate(-4096, 4096);
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    for (std::uint32_t v = 0; v < kVertices; ++v) {  // of few digits: text and floats keep no more
      positions.emplace_back(coordinate(random), coordinate(random), coordinate(random));
      positions.back() /= 64;
      points->InsertNextPoint(positions.back().data());
    }
    vtkNew<vtkCellArray> triangleCells;
    for (std::uint32_t v = 0; v < kVertices; v += 3) {
      triangles.push_back({v, v + 1, v + 2});
      triangleCells->InsertNextCell({v, v + 1, v + 2});
    }
    vtkNew<vtkDoubleArray> field;
    field->SetName("field");
    field->SetNumberOfTuples(kVertices);
    field->Fill(0.5);
    mesh->SetPoints(points);
    mesh->SetPolys(triangleCells);
    mesh->GetPointData()->AddArray(field);
  }
  ~WrittenByVtk() override { std::filesystem::remove(path); }

  template <class Writer>
  void expectReadBack(Writer& writer, const char* kind) {
    path.replace_extension(kind);
    writer.SetFileName(path.c_str());
    writer.SetInputData(mesh);
    ASSERT_EQ(writer.Write(), 1);
    const MeshFile read = readTriangleMesh(path);
    EXPECT_TRUE(read.positions == positions);
    EXPECT_TRUE(read.triangles == triangles);
  }

  static constexpr std::uint32_t kVertices = 1500;  // more than one compressed block
  std::filesystem::path path;
  std::vector<Eigen::Vector3d> positions;
  std::vector<Triangle> triangles;
  vtkNew<vtkPolyData> mesh;
};

TEST_F(WrittenByVtk, Xml) {
  using Writer = vtkXMLPolyDataWriter;
  for (const int mode : {Writer::Ascii, Writer::Binary, Writer::Appended})
    for (const int encoded : {0, 1})
      for (const int compressor : {Writer::NONE, Writer::ZLIB, Writer::LZ4, Writer::LZMA})
        for (const int header : {Writer::UInt32, Writer::UInt64})
          for (const int order : {Writer::LittleEndian, Writer::BigEndian}) {
            SCOPED_TRACE(::testing::Message() << mode << encoded << compressor << header << order);
            vtkNew<Writer> writer;
            writer->SetDataMode(mode);
            writer->SetEncodeAppendedData(encoded);
            writer->SetCompressorType(compressor);
            writer->SetHeaderType(header);
            writer->SetByteOrder(order);
            expectReadBack(*writer, ".vtp");
          }
}

TEST_F(WrittenByVtk, Legacy) {
  for (const int version :
       {vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2, vtkDataWriter::VTK_LEGACY_READER_VERSION_5_1})
    for (const int type : {VTK_ASCII, VTK_BINARY}) {
      SCOPED_TRACE(::testing::Message() << version << type);
      vtkNew<vtkPolyDataWriter> writer;
      writer->SetFileVersion(version);
      writer->SetFileType(type);
      expectReadBack(*writer, ".vtk");
    }
}

TEST_F(WrittenByVtk, StlAndPly) {
  for (const int type : {VTK_ASCII, VTK_BINARY}) {
    SCOPED_TRACE(type);
    vtkNew<vtkSTLWriter> stl;
    stl->SetFileType(type);
    expectReadBack(*stl, ".stl");
    vtkNew<vtkPLYWriter> ply;
    ply->SetFileType(type);
    expectReadBack(*ply, ".ply");
  }
}

}  // namespace
}  // namespace palpate::vtk
