// Part of MeshFiles/Formats.h: Gmsh files.

#include "MeshFiles/Formats.h"
#include "MeshFiles/Output.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

// Source: Gmsh reference manual, "MSH file format" (4.1) and "Legacy formats" (2.2).

namespace palpate::files {

namespace {

struct ElementType {
  std::int64_t type;
  const char* name;
  int nodes;  ///< 0: refused
  Cell cell = Cell::Points;
};
constexpr ElementType kElementTypes[]{{15, "point", 1, Cell::Points},
                                      {1, "line", 2, Cell::Polyline},
                                      {2, "triangle", 3, Cell::Polygon},
                                      {3, "quadrangle", 4, Cell::Polygon},
                                      {4, "tetrahedron", 4, Cell::Tetrahedron},
                                      {5, "hexahedron", 0},
                                      {6, "prism", 0},
                                      {7, "pyramid", 0},
                                      {8, "line of second order", 0},
                                      {9, "triangle of second order", 0},
                                      {10, "quadrangle of second order", 0},
                                      {11, "tetrahedron of second order", 0},
                                      {12, "hexahedron of second order", 0},
                                      {13, "prism of second order", 0},
                                      {14, "pyramid of second order", 0},
                                      {16, "quadrangle of second order", 0},
                                      {17, "hexahedron of second order", 0},
                                      {18, "prism of second order", 0},
                                      {19, "pyramid of second order", 0}};

const ElementType& elementType(std::int64_t type, const FileText& at) {
  const auto found = std::ranges::find(kElementTypes, type, &ElementType::type);
  if (found != std::end(kElementTypes) && found->nodes > 0) return *found;
  const std::string name =
      found != std::end(kElementTypes) ? std::string(" (") + found->name + ")" : "";
  at.refuse(
      "expected points, lines, triangles, quadrangles or tetrahedra of first order, not element "
      "type " +
      std::to_string(type) + name);
}

/// The numbers of nodes, which need not be consecutive.
class NodeTags {
 public:
  void reserve(std::size_t more) { m_tags.reserve(m_tags.size() + more); }
  void add(std::int64_t tag) { m_tags.push_back(tag); }
  std::size_t size() const { return m_tags.size(); }

  /// No tag may be added afterwards.
  void finish(const FileText& at) {
    m_areIndices = true;
    for (std::size_t i = 0; i < m_tags.size(); ++i)
      m_areIndices = m_areIndices && m_tags[i] == static_cast<std::int64_t>(i + 1);
    if (m_areIndices) return;
    m_order.reserve(m_tags.size());
    for (std::size_t i = 0; i < m_tags.size(); ++i)
      m_order.emplace_back(m_tags[i], static_cast<std::uint32_t>(i));
    std::ranges::sort(m_order);
    const auto equal = [](const auto& a, const auto& b) { return a.first == b.first; };
    const auto twice = std::ranges::adjacent_find(m_order, equal);
    if (twice != m_order.end())
      at.refuse("expected different tags of nodes, but two have " + std::to_string(twice->first));
  }

  std::uint32_t indexOf(std::int64_t tag, const FileText& at) const {
    const bool isIndex = m_areIndices && tag >= 1 && tag <= static_cast<std::int64_t>(size());
    if (isIndex) return static_cast<std::uint32_t>(tag - 1);
    const auto found = std::ranges::lower_bound(m_order, std::pair(tag, std::uint32_t{0}));
    if (found == m_order.end() || found->first != tag)
      at.refuse("expected the tag of one of the " + std::to_string(size()) + " nodes, not " +
                std::to_string(tag));
    return found->second;
  }

 private:
  std::vector<std::int64_t> m_tags;
  std::vector<std::pair<std::int64_t, std::uint32_t>> m_order;  ///< empty if tags are indices
  bool m_areIndices = true;
};

class GmshReader {
 public:
  GmshReader(const FileText& text, MeshBuilder& mesh) : m_text(text), m_mesh(mesh) {}

  void read() {
    readFormat();
    bool hasElements = false;
    for (std::string_view name = m_text.word(); !name.empty(); name = m_text.word()) {
      if (!name.starts_with('$') || name.starts_with("$End")) m_text.refuseWord("a section", name);
      hasElements = hasElements || name == "$Elements";
      readSection(name);
    }
    if (!hasElements) m_text.refuseWord("$Elements", "");
  }

 private:
  void readFormat() {
    m_text.expectWord("$MeshFormat");
    const std::string_view version = m_text.word();
    if (version != "2.2" && version != "4.1")
      m_text.refuseWord("version 2.2 or 4.1 of a Gmsh file", version);
    m_isOld = version == "2.2";
    const std::int64_t isBinary = m_text.whole(), size = m_text.whole();
    if ((isBinary != 0 && isBinary != 1) || size != 8)
      m_text.refuse("expected a file type of 0 or 1, and 8 as the size of numbers");
    if (isBinary) {
      m_text.line();
      const std::string_view one = m_text.take(4);
      m_encoding = one[0] == 1 ? Encoding::LittleEndian : Encoding::BigEndian;
      if (one != std::string_view("\1\0\0\0", 4) && one != std::string_view("\0\0\0\1", 4))
        m_text.refuse("expected the binary integer 1");
    }
    m_text.expectWord("$EndMeshFormat");
  }

  void readSection(std::string_view name) {
    const std::string end = "$End" + std::string(name.substr(1));
    if (name == "$Nodes" || name == "$Elements") {
      if (!m_isOld) startNumbers();
      const bool isNodes = name == "$Nodes";
      if (isNodes && m_tags.size() > 0) m_text.refuse("expected one section $Nodes, not two");
      if (isNodes)
        m_isOld ? readOldNodes() : readNodes();
      else
        m_isOld ? readOldElements() : readElements();
      if (isNodes) m_tags.finish(m_text);
      m_text.setEncoding(Encoding::Text);
      return m_text.expectWord(end);
    }
    const std::size_t at = m_text.rest().find(end);
    if (at == std::string_view::npos) m_text.refuseWord(end.substr(0, 40), "");
    m_text.take(at + end.size());
  }

  /// Binary numbers begin in the next line.
  void startNumbers() {
    if (m_encoding == Encoding::Text) return;
    m_text.line();
    m_text.setEncoding(m_encoding);
  }

  std::size_t leastSize(std::size_t numbers, std::size_t bytes) const {
    return m_text.isText() ? 2 * numbers : bytes;
  }

  void readOldNodes() {
    const std::size_t count = m_text.count("nodes", 8);
    startNumbers();
    reserveNodes(count);
    for (std::size_t i = 0; i < count; ++i) {
      m_tags.add(m_text.whole(4));
      readPosition();
    }
  }

  void reserveNodes(std::size_t count) {
    m_mesh.reservePositions(count);
    m_tags.reserve(count);
  }

  void readPosition() {
    Eigen::Vector3d position;
    for (double& x : position) x = m_text.number(m_double);
    m_mesh.addPosition(position, m_text);
  }

  void readOldElements() {
    std::size_t left = m_text.count("elements", 8);
    startNumbers();
    while (left > 0) {
      // Binary elements stand in groups of one type, which begins with the type.
      if (m_text.isText()) m_text.whole();
      const ElementType& type = elementType(m_text.whole(4), m_text);
      const std::size_t group = m_text.isText() ? 1 : m_text.count("elements", 8, 4);
      if (group == 0 || group > left)
        m_text.refuse("expected 1 to " + std::to_string(left) + " elements, not " +
                      std::to_string(group));
      const std::size_t tags = m_text.count("tags", leastSize(1, 4), 4);
      for (std::size_t i = 0; i < group; ++i) {
        if (!m_text.isText()) m_text.whole(4);
        for (std::size_t tag = 0; tag < tags; ++tag) m_text.whole(4);
        readElement(type, 4);
      }
      left -= group;
    }
  }

  void readElement(const ElementType& type, std::size_t bytes) {
    for (int i = 0; i < type.nodes; ++i)
      m_mesh.addCorner(m_tags.indexOf(m_text.whole(bytes), m_text), m_text);
    m_mesh.endCell(type.cell, m_text);
  }

  struct Blocks {
    std::size_t blocks, items;
  };
  Blocks readBlocks(const char* items) {
    const std::size_t blocks = m_text.count("blocks", leastSize(4, 20)),
                      count = m_text.count(items, leastSize(2, 16));
    for (int i = 0; i < 2; ++i) m_text.whole();  // the least and the largest tag
    return {blocks, count};
  }

  void checkAllRead(std::size_t left) const {
    if (left > 0) m_text.refuse(std::to_string(left) + " more are expected in the blocks");
  }

  /// The number of items in a block, of at most `left` items.
  std::size_t blockSize(std::size_t& left) {
    const std::size_t count = m_text.count("items of a block", leastSize(2, 16));
    if (count > left)
      m_text.refuse("expected at most " + std::to_string(left) + " items in this block, not " +
                    std::to_string(count));
    left -= count;
    return count;
  }

  void readNodes() {
    auto [blocks, left] = readBlocks("nodes");
    for (; blocks > 0; --blocks) {
      const std::int64_t dimension = m_text.whole(4);
      m_text.whole(4);  // the entity's tag
      const std::int64_t isParametric = m_text.whole(4);
      if (dimension < 0 || dimension > 3 || (isParametric != 0 && isParametric != 1))
        m_text.refuse("expected a dimension from 0 to 3, and 0 or 1 for parametric coordinates");
      const std::size_t count = blockSize(left);
      m_text.checkCount(count, "nodes", leastSize(4, 32));
      reserveNodes(count);
      for (std::size_t i = 0; i < count; ++i) m_tags.add(m_text.whole());
      for (std::size_t i = 0; i < count; ++i) {
        readPosition();
        m_text.skip(m_double, static_cast<std::size_t>(isParametric ? dimension : 0));
      }
    }
    checkAllRead(left);
  }

  void readElements() {
    auto [blocks, left] = readBlocks("elements");
    for (; blocks > 0; --blocks) {
      for (int i = 0; i < 2; ++i) m_text.whole(4);  // the entity's dimension and tag
      const ElementType& type = elementType(m_text.whole(4), m_text);
      for (std::size_t count = blockSize(left); count > 0; --count) {
        m_text.whole();  // the element's tag
        readElement(type, 8);
      }
    }
    checkAllRead(left);
  }

  FileText m_text;
  MeshBuilder& m_mesh;
  NodeTags m_tags;
  bool m_isOld = false;
  Encoding m_encoding = Encoding::Text;
  NumberType m_double = m_text.typeNamed("double");
};

/// Calls visit(type, dimension, elements) for each kind of element that the mesh has.
template <class F>
void forKinds(const MeshArrays& mesh, F&& visit) {
  if (!mesh.points.empty()) visit(15, 0, pointElements(mesh));
  if (!mesh.segments.empty()) visit(1, 1, mesh.segments);
  if (!mesh.triangles.empty()) visit(2, 2, mesh.triangles);
  if (!mesh.tetrahedra.empty()) visit(4, 3, mesh.tetrahedra);
}

struct Totals {
  std::uint64_t kinds = 0, elements = 0;
  std::int32_t dimension = 0;  ///< the largest
};
Totals totalsOf(const MeshArrays& mesh) {
  Totals totals;
  forKinds(mesh, [&](int, int dimension, const auto& elements) {
    ++totals.kinds;
    totals.elements += elements.size();
    totals.dimension = dimension;
  });
  return totals;
}

void writeOldSections(const MeshArrays& mesh, Output& out) {
  out.text("$Nodes\n").decimal(mesh.positions.size()).text("\n");
  std::int32_t tag = 0;
  for (const Eigen::Vector3d& p : mesh.positions) out.number(++tag).numbers<double>(p).endLine();
  if (!out.isText()) out.text("\n");
  out.text("$EndNodes\n$Elements\n").decimal(totalsOf(mesh).elements).text("\n");
  tag = 0;
  // Each element has two tags: no physical group, and the geometric entity 1.
  forKinds(mesh, [&](std::int32_t type, int, const auto& elements) {
    if (!out.isText())
      out.numbers<std::int32_t>(std::array<std::size_t, 3>{std::size_t(type), elements.size(), 2});
    for (const auto& element : elements) {
      out.number(++tag);
      if (out.isText()) out.number(type).number(2);
      out.number(0).number(1);
      for (const std::uint32_t vertex : element) out.number(static_cast<std::int32_t>(vertex + 1));
      out.endLine();
    }
  });
}

void writeSections(const MeshArrays& mesh, Output& out) {
  const Totals totals = totalsOf(mesh);
  const std::uint64_t nodes = mesh.positions.size();
  const auto addHead = [&](const std::array<std::uint64_t, 4>& numbers) {
    out.numbers<std::uint64_t>(numbers).endLine();
  };
  out.text("$Nodes\n");
  addHead({1, nodes, 1, nodes});
  out.number(totals.dimension).number(1).number(0).number(nodes).endLine();
  for (std::uint64_t tag = 1; tag <= nodes; ++tag) out.number(tag).endLine();
  for (const Eigen::Vector3d& p : mesh.positions) out.numbers<double>(p).endLine();
  if (!out.isText()) out.text("\n");
  out.text("$EndNodes\n$Elements\n");
  addHead({totals.kinds, totals.elements, 1, totals.elements});
  std::uint64_t tag = 0;
  forKinds(mesh, [&](std::int32_t type, std::int32_t dimension, const auto& elements) {
    out.number(dimension).number(1).number(type).number(std::uint64_t{elements.size()}).endLine();
    for (const auto& element : elements) {
      out.number(++tag);
      for (const std::uint32_t vertex : element) out.number(vertex + std::uint64_t{1});
      out.endLine();
    }
  });
}

}  // namespace

void readGmsh(FileText text, MeshBuilder& mesh) { GmshReader(text, mesh).read(); }

std::string writeGmsh(const MeshArrays& mesh, const MeshWriteSettings& settings) {
  Output out(settings.binary ? Encoding::LittleEndian : Encoding::Text);
  out.text("$MeshFormat\n").text(settings.gmsh22 ? "2.2 " : "4.1 ");
  out.text(settings.binary ? "1 8\n" : "0 8\n");
  if (settings.binary) out.number(std::int32_t{1}).text("\n");
  out.text("$EndMeshFormat\n");
  settings.gmsh22 ? writeOldSections(mesh, out) : writeSections(mesh, out);
  if (settings.binary) out.text("\n");
  return out.text("$EndElements\n").take();
}

}  // namespace palpate::files
