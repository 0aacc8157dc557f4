// Runs a captured collision problem, compares it with brute force, and shrinks it while they
// differ.
#include "CommandLine.h"
#include "Shrink.h"

#include <palpate/Capture.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <tuple>

namespace {

using namespace palpate;

using scenes::dataOf;
using scenes::solve;

bool same(const CollisionData& l, const CollisionData& r) {
  return l.hash() == r.hash() && l.earliestTimeOfImpact() == r.earliestTimeOfImpact();
}

bool differs(const CollisionProblem& problem) {
  const OctreeBasedCD octree = solve(problem, Engine::Octree),
                      oracle = solve(problem, Engine::BruteForce);
  return std::any_of(problem.pairs.begin(), problem.pairs.end(), [&](const auto& pair) {
    return !same(dataOf(octree, pair), dataOf(oracle, pair));
  });
}

std::array<std::uint32_t, 4> idsOf(const VertexTriangleContact& c) {
  return {c.vertex, c.triangle};
}
std::array<std::uint32_t, 4> idsOf(const EdgeEdgeContact& c) {
  return {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
}
std::array<std::uint32_t, 4> idsOf(const ElementPair& pair) { return {pair.a, pair.b}; }

std::string nameOf(const VertexTriangleContact& c) {
  return "vertex " + std::to_string(c.vertex) + ", triangle " + std::to_string(c.triangle);
}
std::string nameOf(const EdgeEdgeContact& c) {
  return "edge (" + std::to_string(c.edgeA[0]) + ", " + std::to_string(c.edgeA[1]) + "), edge (" +
         std::to_string(c.edgeB[0]) + ", " + std::to_string(c.edgeB[1]) + ")";
}
std::string nameOf(const ElementPair& pair) {
  return "triangle " + std::to_string(pair.a) + ", triangle " + std::to_string(pair.b);
}

auto valuesOf(const VertexTriangleContact& c) {
  return std::tuple(c.weights[0], c.weights[1], c.weights[2], c.normal[0], c.normal[1], c.normal[2],
                    c.distance, c.timeOfImpact);
}
auto valuesOf(const EdgeEdgeContact& c) {
  return std::tuple(c.weightA, c.weightB, c.normal[0], c.normal[1], c.normal[2], c.distance,
                    c.timeOfImpact);
}
auto valuesOf(const ElementPair&) { return 0; }

template <class Contact>
void printDifferences(const char* list, std::span<const Contact> found,
                      std::span<const Contact> expected) {
  const auto sorted = [](std::span<const Contact> contacts) {
    std::vector<Contact> all(contacts.begin(), contacts.end());
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& l, const auto& r) { return idsOf(l) < idsOf(r); });
    return all;
  };
  const std::vector<Contact> f = sorted(found), e = sorted(expected);
  const auto print = [&](const char* how, const Contact& contact) {
    std::printf("  %s %s: %s\n", how, list, nameOf(contact).c_str());
  };
  for (std::size_t i = 0, j = 0; i < f.size() || j < e.size();) {
    if (j == e.size() || (i < f.size() && idsOf(f[i]) < idsOf(e[j]))) {
      print("false positive in", f[i++]);
    } else if (i == f.size() || idsOf(e[j]) < idsOf(f[i])) {
      print("false negative in", e[j++]);
    } else {
      if (valuesOf(f[i]) != valuesOf(e[j])) print("different values in", f[i]);
      ++i, ++j;
    }
  }
}

/// Prints the contacts of every pair. Returns whether any differ from brute force.
bool report(const CollisionProblem& problem) {
  constexpr const char* kMethods[]{"Auto", "Intersection", "Proximity", "Continuous",
                                   "DistanceField"};
  const OctreeBasedCD octree = solve(problem, Engine::Octree),
                      oracle = solve(problem, Engine::BruteForce);
  std::size_t different = 0;
  for (const CollisionProblem::Pair& pair : problem.pairs) {
    const CollisionData &found = dataOf(octree, pair), &expected = dataOf(oracle, pair);
    const bool equal = same(found, expected);
    different += !equal;
    std::printf(
        "pair (%u, %u), %s: %zu vertex-triangle, %zu triangle-vertex, %zu edge-edge, %zu "
        "intersecting: %s\n",
        static_cast<unsigned>(problem.geometries[pair.a].id),
        static_cast<unsigned>(problem.geometries[pair.b].id),
        kMethods[static_cast<int>(pair.method)], found.vertexTriangle().size(),
        found.triangleVertex().size(), found.edgeEdge().size(),
        found.intersectingTriangles().size(), equal ? "equal to brute force" : "differs");
    if (equal) continue;
    printDifferences("vertexTriangle", found.vertexTriangle(), expected.vertexTriangle());
    printDifferences("triangleVertex", found.triangleVertex(), expected.triangleVertex());
    printDifferences("edgeEdge", found.edgeEdge(), expected.edgeEdge());
    printDifferences("intersectingTriangles", found.intersectingTriangles(),
                     expected.intersectingTriangles());
    if (found.earliestTimeOfImpact() != expected.earliestTimeOfImpact())
      std::printf("  earliest time of impact %.17g, by brute force %.17g\n",
                  found.earliestTimeOfImpact(), expected.earliestTimeOfImpact());
  }
  std::printf("%zu of %zu pairs differ\n", different, problem.pairs.size());
  return different > 0;
}

std::size_t triangleCount(const CollisionProblem& problem) {
  std::size_t count = 0;
  for (const CollisionProblem::Geometry& mesh : problem.geometries) count += mesh.triangles.size();
  return count;
}

}  // namespace

/// Exit codes as palpate-check: 1 if contacts differ from those of brute force.
int main(int argc, char** argv) {
  CLI::App app("Replays a captured collision problem and compares it with brute force.", "Replay");
  std::string file, out;
  app.add_option("file", file, "a capture")->required();
  app.add_option("--shrink", out, "file for a smaller problem that still differs");
  return scenes::exitCodeOf(app, [&] {
    app.parse(argc, argv);
    const CollisionProblem problem = readCapture(file);
    const bool fails = report(problem);
    if (fails && !out.empty()) {
      const CollisionProblem small = scenes::shrink(problem, differs);
      writeCapture(small, out);
      std::printf("%zu of %zu triangles still differ: %s\n", triangleCount(small),
                  triangleCount(problem), out.c_str());
    } else if (!out.empty()) {
      std::puts("nothing to shrink");
    }
    return !fails;
  });
}
