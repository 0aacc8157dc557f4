#include "ParaView.h"

#include "ContactPoints.h"
#include "WriteFile.h"

#include <palpate/Error.h>

#include <Eigen/Geometry>

#include <cstdio>

namespace palpate::scenes {

using Eigen::Vector3d;

namespace {

void append(std::string& text, double value) {
  std::array<char, 32> digits;
  text.append(digits.data(), std::snprintf(digits.data(), digits.size(), "%.17g ", value));
}

std::string array(const std::string& type, const std::string& name, int components,
                  const std::string& values) {
  return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
         std::to_string(components) + "\" format=\"ascii\">" + values + "</DataArray>\n";
}

std::string field(const std::string& name, const std::vector<double>& values, int components) {
  std::string text;
  for (const double value : values) append(text, value);
  return array("Float64", name, components, text);
}

template <class Cell>
std::string cells(const std::string& tag, const std::vector<Cell>& all) {
  std::string connectivity, offsets;
  std::size_t end = 0;
  for (const Cell& cell : all) {
    for (const std::uint32_t vertex : cell) connectivity += std::to_string(vertex) + " ";
    offsets += std::to_string(end += cell.size()) + " ";
  }
  return "<" + tag + ">\n" + array("Int64", "connectivity", 1, connectivity) +
         array("Int64", "offsets", 1, offsets) + "</" + tag + ">\n";
}

}  // namespace

void VtpText::addPointField(const std::string& name, const std::vector<double>& values,
                            int components) {
  m_pointFields += field(name, values, components);
}

void VtpText::addCellField(const std::string& name, const std::vector<double>& values) {
  m_cellFields += field(name, values, 1);
}

std::string VtpText::text() const {
  std::vector<double> coordinates;
  for (const Vector3d& p : points) coordinates.insert(coordinates.end(), p.data(), p.data() + 3);
  std::vector<std::array<std::uint32_t, 1>> ones;
  for (const std::uint32_t vertex : vertices) ones.push_back({vertex});
  const auto count = [](const char* name, std::size_t value) {
    return std::string(" ") + name + "=\"" + std::to_string(value) + "\"";
  };
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
         "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<Piece" +
         count("NumberOfPoints", points.size()) + count("NumberOfVerts", vertices.size()) +
         count("NumberOfLines", lines.size()) + count("NumberOfStrips", 0) +
         count("NumberOfPolys", triangles.size()) + ">\n<PointData>\n" + m_pointFields +
         "</PointData>\n<CellData>\n" + m_cellFields + "</CellData>\n<Points>\n" +
         field("Points", coordinates, 3) + "</Points>\n" + cells("Verts", ones) +
         cells("Lines", lines) + cells("Polys", triangles) + "</Piece>\n</PolyData>\n</VTKFile>\n";
}

VtpText bodiesVtp(World& world) {
  VtpText file;
  std::vector<double> ofVertices, ofLines, ofTriangles;
  for (World::BodyId id = 0; id < world.bodies().size(); ++id) {
    const World::Body& body = world.bodies()[id];
    const auto first = static_cast<std::uint32_t>(file.points.size());
    const std::span<const Vector3d> positions = world.positions(id);
    file.points.insert(file.points.end(), positions.begin(), positions.end());
    for (const Vector3d& p : body.drawn.positions)
      file.points.push_back(body.rotation * p + body.translation);
    for (std::uint32_t i = 0; body.type == GeometryType::Points && i < body.count; ++i)
      file.vertices.push_back(first + i);
    for (const auto& [p, q] : body.segments) file.lines.push_back({first + p, first + q});
    for (const auto* triangles : {&body.triangles, &body.drawn.triangles})
      for (const auto& [a, b, c] : *triangles)
        file.triangles.push_back({first + a, first + b, first + c});
    ofVertices.resize(file.vertices.size(), static_cast<double>(id));
    ofLines.resize(file.lines.size(), static_cast<double>(id));
    ofTriangles.resize(file.triangles.size(), static_cast<double>(id));
  }
  for (const auto* part : {&ofLines, &ofTriangles})
    ofVertices.insert(ofVertices.end(), part->begin(), part->end());
  file.addCellField("body", ofVertices);
  return file;
}

VtpText contactsVtp(World& world) {
  VtpText file;
  std::vector<double> distances, times, normals, pairs, kinds;
  for (const ContactPoint& contact : contactPoints(world)) {
    file.vertices.push_back(static_cast<std::uint32_t>(file.points.size()));
    file.points.push_back(contact.at);
    distances.push_back(contact.distance);
    times.push_back(contact.time);
    normals.insert(normals.end(), contact.normal.data(), contact.normal.data() + 3);
    kinds.push_back(static_cast<double>(contact.kind));
    pairs.push_back(static_cast<double>(contact.pair));
  }
  file.addPointField("distance", distances);
  file.addPointField("time of impact", times);
  file.addPointField("normal", normals, 3);
  file.addPointField("pair", pairs);
  file.addPointField("kind", kinds);
  return file;
}

VtpText octreeVtp(const LooseOctree& octree) {
  VtpText file;
  std::vector<double> depths, elements, geometries;
  std::vector<LooseOctree::Node> nodes;
  for (const GeometryId geometry : octree.geometries())
    for (const LooseOctree::Node& node : octree.nodes(geometry))
      if (!node.elements.empty()) nodes.push_back(node);
  for (const LooseOctree::Node& node : nodes) {
    const auto first = static_cast<std::uint32_t>(file.points.size());
    using Box = Eigen::AlignedBox3d;
    for (int corner = 0; corner < 8; ++corner)  // bit 0: x, 1: y, 2: z
      file.points.push_back(node.bounds.corner(static_cast<Box::CornerType>(corner)));
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      for (const std::uint32_t bit : {1u, 2u, 4u})
        if (!(corner & bit)) file.lines.push_back({first + corner, first + (corner | bit)});
    }
    depths.resize(file.lines.size(), node.depth);
    elements.resize(file.lines.size(), static_cast<double>(node.elements.size()));
    geometries.resize(file.lines.size(), static_cast<double>(node.geometry));
  }
  file.addCellField("depth", depths);
  file.addCellField("elements", elements);
  file.addCellField("geometry", geometries);
  return file;
}

ParaViewSeries::ParaViewSeries(std::filesystem::path folder)
    : m_folder(std::move(folder)), m_partial(m_folder) {
  m_partial += ".part";
  makeFolder(m_partial);
}

ParaViewSeries::~ParaViewSeries() {
  std::error_code ignored;
  std::filesystem::remove_all(m_partial, ignored);
}

void ParaViewSeries::add(World& world) {
  const std::array<std::pair<std::string, VtpText>, 3> parts{
      {{"bodies", bodiesVtp(world)},
       {"contacts", contactsVtp(world)},
       {"octree", octreeVtp(world.detection().octree())}}};
  for (std::size_t part = 0; part < parts.size(); ++part) {
    const std::string name = parts[part].first + "_" + std::to_string(m_frames) + ".vtp";
    writeWhole(m_partial / name, parts[part].second.text());
    m_entries += "<DataSet timestep=\"" + std::to_string(m_frames) + "\" part=\"" +
                 std::to_string(part) + "\" file=\"" + name + "\"/>\n";
  }
  ++m_frames;
}

void ParaViewSeries::finish(const std::string& name) {
  writeWhole(
      m_partial / (name + ".pvd"),
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n" +
          m_entries + "</Collection>\n</VTKFile>\n");
  std::error_code fault;
  std::filesystem::remove_all(m_folder, fault);
  if (!fault) std::filesystem::rename(m_partial, m_folder, fault);
  if (fault)
    throw Error(ErrorCode::File, "The folder \"" + m_folder.string() + "\" cannot be written.");
}

}  // namespace palpate::scenes
