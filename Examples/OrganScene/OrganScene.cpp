// Five organs breathe, or the user's own meshes glide through each other: contacts of each
// frame, what each stage of it cost, and a picture.
#include "CommandLine.h"
#include "SceneProgram.h"
#include "Scenes.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <optional>

namespace palpate::scenes {
namespace {

const std::map<std::string, Method> kMethods{{"auto", Method::Auto},
                                             {"intersection", Method::Intersection},
                                             {"proximity", Method::Proximity},
                                             {"continuous", Method::Continuous}};

struct Options {
  std::vector<std::string> meshes;
  Method method = Method::Auto;
  std::optional<double> thickness;
};

Scene sceneOf(const Options& options) {
  if (options.meshes.empty()) return breathingOrgans();
  std::vector<SceneMesh> meshes;
  for (const std::string& path : options.meshes) meshes.push_back(readMesh(path));
  return glidingMeshes(std::move(meshes));
}

class OrganScene : public LiveScene {
 public:
  OrganScene(const Options& options, int threads)
      : m_isOfOrgans(options.meshes.empty()),
        m_scene(sceneOf(options)),
        m_method(options.method),
        m_world(threads) {
    const bool touching = m_method == Method::Intersection || m_method == Method::Continuous;
    m_thickness = options.thickness.value_or(touching ? 0.0 : m_scene.thickness);
    const std::vector<Organ> organs = organMeshes();
    for (std::size_t m = 0; m < m_scene.meshes.size(); ++m) {
      const std::string name = m_isOfOrgans ? organs[m].name : "Mesh " + std::to_string(m + 1);
      m_world.addMesh(name, m_scene.meshes[m], 0.0);
    }
    for (const auto& [a, b] : m_scene.pairs)
      m_world.addPair(a, b, {.method = m_method, .thickness = m_thickness}, 0);
  }

  World& world() override { return m_world; }

  std::string settings() override {
    const auto named = std::find_if(kMethods.begin(), kMethods.end(),
                                    [this](const auto& entry) { return entry.second == m_method; });
    std::array<char, 200> text;
    std::snprintf(text.data(), text.size(),
                  "%zu meshes, %zu triangles, %zu pairs, %s, thickness %g", m_scene.meshes.size(),
                  m_scene.triangleCount(), m_scene.pairs.size(), named->first.c_str(), m_thickness);
    return text.data();
  }

  std::vector<BodyLook> looks() override {
    constexpr std::array kColours{kLiverColour, kStomachColour, kKidneyColour, kSpleenColour,
                                  Colour{0.45, 0.56, 0.30}};
    std::vector<BodyLook> looks;
    for (World::BodyId m = 0; m < m_scene.meshes.size(); ++m)
      looks.push_back({m, m_world.bodies()[m].name, kColours[m % kColours.size()]});
    if (m_isOfOrgans) looks.front().opacity = 0.45;  // the contacts are behind the liver
    return looks;
  }

  PictureView view() override { return {.from = {0.1, -1, -0.2}}; }

  void computeFrame(int frame) override {
    m_world.predict(1.0, Eigen::Vector3d::Zero(), 0.0);
    for (World::BodyId m = 0; m < m_scene.meshes.size(); ++m) {
      m_scene.positions(frame, m, m_positions);
      std::copy(m_positions.begin(), m_positions.end(), m_world.positions(m).begin());
    }
    if (m_found.empty()) m_world.commit();  // the first moves from nowhere else
    m_world.detectOnly();
    const FrameStatistics& found = m_world.detection().statistics();
    m_found.emplace_back(std::max(found.contacts, found.intersectingTriangles), frame);
    std::size_t untrusted = 0;
    for (const World::Pair& pair : m_world.pairs()) {
      const Validity& validity = m_world.contacts(pair.a, pair.b).validity();
      untrusted += !validity.trusted && !validity.startedApart;
    }
    m_untrusted = std::max(m_untrusted, untrusted);
    m_world.commit();
  }

  std::vector<std::pair<std::string, double>> values() override {
    const FrameStatistics& frame = m_world.detection().statistics();
    const OctreeStatistics& octree = m_world.detection().octree().statistics();
    std::vector<std::pair<std::string, double>> values;
    const auto add = [&](const char* name, auto value) {
      values.emplace_back(name, static_cast<double>(value));
    };
    add("candidate pairs", frame.candidatePairs);
    add("triangles", m_scene.triangleCount());
    add("feature pairs", frame.featurePairs);
    add("intersecting pairs", frame.intersectingTriangles);
    add("octree nodes", octree.nodesInUse);
    add("octree depth", octree.deepestLevel);
    add("octrees rebuilt", frame.rebuiltOctrees);
    return values;
  }

  /// Why some answers are not trusted. Nothing responds here, so that organs come to overlap.
  std::vector<std::string> findings() override {
    if (m_untrusted == 0) return {};
    std::array<char, 160> text;
    std::snprintf(
        text.data(), text.size(),
        "not trusted          at most %zu of %zu pairs: nothing keeps these bodies apart, "
        "and they overlap",
        m_untrusted, m_scene.pairs.size());
    return {text.data()};
  }

  /// With about the median number of contacts of the frames that have any.
  std::optional<int> frameToShow() override {
    std::erase_if(m_found, [](const auto& frame) { return frame.first == 0; });
    if (m_found.empty()) return {};
    std::sort(m_found.begin(), m_found.end());
    return m_found[m_found.size() / 2].second;
  }

 private:
  bool m_isOfOrgans;
  Scene m_scene;
  Method m_method;
  double m_thickness;
  World m_world;
  std::size_t m_untrusted = 0;  ///< the most pairs that overlap in one frame
  std::vector<Eigen::Vector3d> m_positions;
  std::vector<std::pair<std::size_t, int>> m_found;  ///< in each frame
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  Options options;
  return runScene(
      {.name = "OrganScene",
       .description = "Organs breathe, slide along each other and overlap.",
       .frames = 120,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .isUnitFree = true,
       .table = {"frame ms", "collision ms", "contacts", "candidate pairs", "triangles"},
       .addOptions =
           [&](CLI::App& app) {
             app.add_option("--mesh", options.meshes,
                            "OBJ, STL, PLY or VTK files to use instead of the organs");
             app.add_option_function<std::string>(
                    "--method",
                    [&](const std::string& name) { options.method = kMethods.at(name); },
                    "how contacts are found (default: auto)")
                 ->type_name("METHOD")
                 ->check(oneOf({"auto", "intersection", "proximity", "continuous"}));
             app.add_option("--thickness", options.thickness,
                            "distance under which two features touch; if absent 1 mm for the "
                            "organs, a twentieth of the mean edge for meshes, and 0 for "
                            "intersection and continuous")
                 ->check(between(0.0, 1e9));
           },
       .make = [&](int threads) { return std::make_unique<OrganScene>(options, threads); }},
      count, arguments);
}
