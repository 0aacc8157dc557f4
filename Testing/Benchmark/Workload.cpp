#include "Workload.h"

#include <Scenes.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;

struct PublishedFrames {
  const char *name, *first, *second;
};
// Scenes come with a thickness of a twentieth of their mean edge. The benchmark
// inflates both boxes of a pair by it, so that the thickness of the pair is a tenth.
constexpr double kInflated = 2;
constexpr PublishedFrames kPublished[] = {
    {"cloth-funnel", "cloth-funnel/frames/227.ply", "cloth-funnel/frames/228.ply"},
    {"rod-twist", "rod-twist/frames/3036.ply", "rod-twist/frames/3037.ply"}};

std::filesystem::path frameFolder(const std::string& sharedData) {
  return std::filesystem::path(sharedData) / "ccd-scenes";
}

/// Binary PLY with double positions and triangles as "uint8 3, int32 x 3", as the published frames
/// are.
scenes::SceneMesh readPly(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  std::size_t vertices = 0, faces = 0;
  while (std::getline(file, line) && line != "end_header") {
    if (line.starts_with("element vertex ")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
  }
  scenes::SceneMesh mesh;
  mesh.positions.resize(vertices);
  file.read(reinterpret_cast<char*>(mesh.positions.data()),
            static_cast<std::streamsize>(vertices * sizeof(Vector3d)));
  mesh.triangles.resize(faces);
  for (Triangle& triangle : mesh.triangles) {
    if (file.get() != 3) throw std::runtime_error(path.string() + ": not a triangle");
    file.read(reinterpret_cast<char*>(triangle.data()), sizeof triangle);
  }
  if (!file) throw std::runtime_error(path.string() + ": cannot be read");
  return mesh;
}

/// Two consecutive frames of a simulation, there and back.
Workload published(const PublishedFrames& names, std::size_t frames,
                   const std::string& sharedData) {
  const scenes::SceneMesh first = readPly(frameFolder(sharedData) / names.first);
  const scenes::SceneMesh second = readPly(frameFolder(sharedData) / names.second);
  Workload workload;
  workload.name = names.name;
  workload.task.meshes = {first.triangles};
  workload.task.pairs = {{0, 0}};
  workload.task.thickness = kInflated * scenes::meanEdge({first}) / 20;
  for (std::size_t i = 0; i < (frames ? frames : 10); ++i)
    workload.frames.push_back({i % 2 ? second.positions : first.positions});
  return workload;
}

scenes::Scene sceneNamed(const std::string& name) {
  if (name == "organs") return scenes::organs();
  if (name == "cloth") return scenes::clothOnBall();
  if (name == "uneven") return scenes::unevenBodies();
  if (name == "folded-cloth") return scenes::foldedCloth();
  if (name == "twisted-rods") return scenes::twistedRods();
  if (name.starts_with("sheets-")) {
    const std::size_t unit = name.ends_with('M') ? 1'000'000 : 1'000;
    return scenes::interleavedSheets(std::stoul(name.substr(7)) * unit);
  }
  throw std::runtime_error("no scene is called " + name);
}

}  // namespace

std::size_t Workload::triangles() const {
  std::size_t count = 0;
  for (const auto& mesh : task.meshes) count += mesh.size();
  return count;
}

std::vector<std::string> workloadNames(const std::string& sharedData) {
  std::vector<std::string> names = {"organs",     "cloth",        "uneven",
                                    "sheets-16K", "sheets-64K",   "sheets-256K",
                                    "sheets-1M",  "folded-cloth", "twisted-rods"};
  for (const PublishedFrames& frames : kPublished)
    if (std::filesystem::exists(frameFolder(sharedData) / frames.second))
      names.push_back(frames.name);
  return names;
}

Workload makeWorkload(const std::string& name, std::size_t frames, const std::string& sharedData) {
  for (const PublishedFrames& names : kPublished)
    if (name == names.name) return published(names, frames, sharedData);
  const scenes::Scene scene = sceneNamed(name);
  Workload workload;
  workload.name = name;
  for (const scenes::SceneMesh& mesh : scene.meshes) workload.task.meshes.push_back(mesh.triangles);
  for (const auto& [a, b] : scene.pairs) workload.task.pairs.push_back({a, b});
  workload.task.thickness = kInflated * scene.thickness;
  const auto period = static_cast<std::size_t>(scene.frames);
  if (frames == 0) frames = std::clamp<std::size_t>(3'000'000 / workload.triangles(), 4, period);
  // Less than a whole period starts at its quarter, where the meshes move and touch.
  const std::size_t first = frames < period ? period / 4 : 0;
  workload.frames.assign(frames, Positions(scene.meshes.size()));
  for (std::size_t i = 0; i < frames; ++i)
    for (std::size_t mesh = 0; mesh < scene.meshes.size(); ++mesh)
      scene.positions(static_cast<int>(first + i), mesh, workload.frames[i][mesh]);
  return workload;
}

void addFarTriangle(Workload& workload) {
  const auto corner = static_cast<std::uint32_t>(workload.frames[0][0].size());
  workload.task.meshes[0].push_back({corner, corner + 1, corner + 2});
  for (Positions& frame : workload.frames) {
    Vector3d min = frame[0][0], max = min;
    for (const auto& positions : frame)
      for (const Vector3d& p : positions) min = min.cwiseMin(p), max = max.cwiseMax(p);
    const double size = (max - min).maxCoeff();
    const Vector3d far = max + Vector3d(1, 0.7, 0.3) * 1e6 * size;
    for (const Vector3d& offset : {Vector3d(0, 0, 0), Vector3d(0.01, 0, 0), Vector3d(0, 0.01, 0)})
      frame[0].push_back(far + offset * size);
  }
}

}  // namespace palpate::benchmark
