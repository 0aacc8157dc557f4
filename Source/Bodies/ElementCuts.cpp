#include "Bodies/ElementCuts.h"

#include "Core/MemoryBudget.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

constexpr std::uint32_t kNoGroup = 0xffffffffu;

}  // namespace

bool ElementCuts::apply(const TriangleMesh& mesh, const FloatFrame& frame,
                        const OctreeSettings& settings, bool keepsBoxes, Octree& octree,
                        OrderedElements& ordered, OctreeSlices& slices) {
  const MeshTopology& topology = mesh.topology;
  if (isLarge(topology.elements.size() - m_elements, ordered) || 2 * m_replaced > ordered.size())
    return false;
  findGroups(octree);
  const std::uint64_t before = std::exchange(m_groupsLayout, 0);
  m_cut.before = m_cut.after = 0;
  Changes changes;
  findLeaving(octree, ordered, changes);
  findJoining(mesh, frame, octree, changes);
  reserveAmortized(m_groupOf, topology.elements.size());
  m_groupOf.resize(topology.elements.size(), kNoGroup);
  if (!joinGroups(octree, 2 * settings.maxElementsPerLeaf, changes)) return false;
  if (!m_cut.groups.empty()) {
    const auto moves = octree.replace(changes.places, changes.joining, keepsBoxes);
    ordered.follow(topology, octree, moves, changes.joining);
    m_replaced += changes.places.size() + changes.joining.size();
  }
  slices.follow({mesh, ordered.triangles(), frame, octree}, before, m_cut.groups);
  addNeighbours(topology, changes.vertices);
  m_cut.before = before;
  m_groupsLayout = m_cut.after = octree.layout();
  return true;
}

void ElementCuts::finish(const MeshTopology& topology) {
  m_removed.clear();
  m_elements = topology.elements.size();
}

/// Makes m_groupOf for the present layout.
void ElementCuts::findGroups(const Octree& octree) {
  if (m_groupsLayout == octree.layout()) return;
  m_groupsLayout = 0;
  m_groupOf.reserve(withSpare(m_elements));
  m_groupOf.assign(m_elements, kNoGroup);
  const auto order = octree.order(), groups = octree.groups();
  for (std::uint32_t g = 0; g + 1 < groups.size(); ++g)
    for (std::uint32_t i = groups[g]; i < groups[g + 1]; ++i) m_groupOf[order[i]] = g;
  m_groupsLayout = octree.layout();
}

/// Begins m_cut.groups with the groups that elements leave.
void ElementCuts::findLeaving(const Octree& octree, const OrderedElements& ordered,
                              Changes& changes) {
  m_cut.groups.clear();
  for (const std::uint32_t id : m_removed)  // also those that were added since the last update
    if (id < m_elements) m_cut.groups.push_back(std::exchange(m_groupOf[id], kNoGroup));
  sortUnique(m_cut.groups);
  const auto groups = octree.groups();
  for (const std::uint32_t group : m_cut.groups)
    for (std::uint32_t i = groups[group]; i < groups[group + 1]; ++i)
      if (m_groupOf[octree.order()[i]] == kNoGroup) {
        const Triangle& corners = ordered.triangles()[i];
        changes.places.push_back(i);
        changes.vertices.insert(changes.vertices.end(), corners.begin(), corners.end());
      }
}

/// Finds groups that are near for the elements that were added.
void ElementCuts::findJoining(const TriangleMesh& mesh, const FloatFrame& frame,
                              const Octree& octree, Changes& changes) const {
  const MeshTopology& topology = mesh.topology;
  for (auto id = static_cast<std::uint32_t>(m_elements); id < topology.elements.size(); ++id) {
    if (topology.isRemoved(id)) continue;
    FloatBox box;
    for (const std::uint32_t vertex : topology.elements[id]) {
      const FloatPoint p = frame(mesh.now.body()[vertex]);
      box.add(FloatBox{{p.x, p.y, p.z, 0}, {p.x, p.y, p.z, 0}});
      changes.vertices.push_back(vertex);
    }
    changes.joining.push_back({octree.nodes().groupNear(box), id});
  }
  std::sort(changes.joining.begin(), changes.joining.end(), [](const auto& a, const auto& b) {
    return std::pair(a.group, a.element) < std::pair(b.group, b.element);
  });
}

/// Enters the elements that join in m_groupOf, and their groups in m_cut. Returns false if a group
/// would hold more elements than before, and more than mostInGroup.
bool ElementCuts::joinGroups(const Octree& octree, std::int64_t mostInGroup,
                             const Changes& changes) {
  const auto groups = octree.groups();
  const auto& [places, joining, vertices] = changes;
  for (auto first = joining.begin(); first != joining.end();) {
    const std::uint32_t group = first->group, size = groups[group + 1] - groups[group];
    const auto last =
        std::find_if(first, joining.end(), [=](const auto& one) { return one.group != group; });
    const auto end = std::lower_bound(places.begin(), places.end(), groups[group + 1]);
    const auto joined = last - first,
               left = end - std::lower_bound(places.begin(), end, groups[group]);
    if (joined > left && size + joined - left > std::max<std::int64_t>(size, mostInGroup))
      return false;
    m_cut.groups.push_back(group);
    first = last;
  }
  sortUnique(m_cut.groups);
  for (const auto& [group, element] : joining) m_groupOf[element] = group;
  return true;
}

/// Adds to m_cut the groups of elements with one of these vertices.
void ElementCuts::addNeighbours(const MeshTopology& topology,
                                CountedVector<std::uint32_t>& vertices) {
  sortUnique(vertices);
  CountedVector<std::uint32_t>& groups = m_cut.groups;
  for (const std::uint32_t vertex : vertices)
    for (const std::uint32_t element : topology.vertexTriangles[vertex])
      if (const std::uint32_t group = m_groupOf[element]; groups.empty() || group != groups.back())
        groups.push_back(group);
  sortUnique(groups);
}

void ElementCuts::releaseMemory() {
  m_groupOf = {};
  m_groupsLayout = 0;
}

}  // namespace palpate
