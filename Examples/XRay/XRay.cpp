// An X-ray image of five organs that breathe in each frame, from the lengths of the rays' ways
// through each organ.
#include "CommandLine.h"
#include "Scenes.h"
#include "WriteFile.h"

#include <palpate/OctreeBasedCD.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

constexpr double kBudget = 1000.0 / 30;  // ms per image
constexpr double kWidth = 280;           // mm, of the image
const Vector3d kCentre(12, -kWidth, -4);
/// Per mm, of each organ: so that all are seen, as after a contrast agent.
constexpr std::array kAttenuation{0.01, 0.012, 0.024, 0.018, 0.045};

struct Options {
  int frames = 120, pixels = 256, threads = 0;
  std::filesystem::path out = "out/xray";
};

double volumeOf(const std::vector<Vector3d>& positions, const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const auto& [a, b, c] : triangles)
    sum += positions[a].cross(positions[b]).dot(positions[c]) / 6;
  return sum;
}

/// The length of a ray's way through a closed body, whose hits are in order.
double lengthInside(std::span<const RayHit> hits) {
  double length = 0, entered = 0;
  int depth = 0;
  for (const RayHit& hit : hits) {
    if (!hit.crosses) continue;
    if (hit.frontFace && depth++ == 0) entered = hit.t;
    if (!hit.frontFace && --depth == 0) length += hit.t - entered;
  }
  return length;
}

class XRay {
 public:
  explicit XRay(const Options& options) : m_pixels(options.pixels), m_scene(breathingOrgans()) {
    Settings settings;
    settings.threads = options.threads;
    m_detection = std::make_unique<OctreeBasedCD>(settings);
    for (const SceneMesh& mesh : m_scene.meshes)
      m_ids.push_back(m_detection->addTriangleMesh(mesh.positions, mesh.triangles));
    // Parallel rays, from the front. Neighbours in the image are neighbours in the batch.
    for (int y = 0; y < m_pixels; ++y)
      for (int x = 0; x < m_pixels; ++x)
        m_rays.push_back(
            {kCentre + kWidth * Vector3d((x + 0.5) / m_pixels - 0.5, 0, 0.5 - (y + 0.5) / m_pixels),
             {0, 1, 0}});
  }

  /// Moves the organs and updates their octrees.
  void move(int frame) {
    for (std::size_t m = 0; m < m_ids.size(); ++m) {
      m_scene.positions(frame, m, m_positions);
      m_detection->setPositions(m_ids[m], m_positions);
    }
    m_detection->advance();
    m_detection->update();
  }
  /// Sums up the attenuation along each ray.
  void expose() {
    m_depth.assign(m_rays.size(), 0.0);
    m_volumes.clear();
    const SpatialQueries queries = m_detection->queries();
    for (std::size_t m = 0; m < m_ids.size(); ++m) {
      queries.allHits(m_ids[m], m_rays, m_hits, m_begins);
      double sum = 0;
      for (std::size_t i = 0; i < m_rays.size(); ++i) {
        const double length =
            lengthInside({m_hits.data() + m_begins[i], m_hits.data() + m_begins[i + 1]});
        m_depth[i] += kAttenuation[m] * length;
        sum += length;
      }
      m_volumes.push_back(sum * std::pow(kWidth / m_pixels, 2));
    }
  }
  /// Throws if an organ's volume in the image is not that of its mesh.
  void check(int frame) {
    for (std::size_t m = 0; m < m_ids.size(); ++m) {
      m_scene.positions(frame, m, m_positions);
      const double volume = volumeOf(m_positions, m_scene.meshes[m].triangles),
                   across = std::cbrt(volume) * m_pixels / kWidth;  // pixels
      if (!(std::abs(m_volumes[m] - volume) <= 6 * volume / (across * across)))
        throw BrokenPromise("Frame " + std::to_string(frame) + ": the image of organ " +
                            std::to_string(m) + " has the volume " + std::to_string(m_volumes[m]) +
                            " mm³, the organ " + std::to_string(volume) + " mm³.");
    }
  }
  /// As PGM. The less light arrives, the brighter is a pixel.
  std::string picture() const {
    std::string text =
        "P5\n" + std::to_string(m_pixels) + " " + std::to_string(m_pixels) + "\n255\n";
    for (const double depth : m_depth)
      text += static_cast<char>(static_cast<unsigned char>(255.0 * (1.0 - std::exp(-depth)) + 0.5));
    return text;
  }
  std::size_t triangles() const { return m_scene.triangleCount(); }

 private:
  int m_pixels;
  Scene m_scene;
  std::unique_ptr<OctreeBasedCD> m_detection;
  std::vector<GeometryId> m_ids;
  std::vector<Ray> m_rays;
  std::vector<Vector3d> m_positions;
  std::vector<RayHit> m_hits;
  std::vector<std::size_t> m_begins;
  std::vector<double> m_depth;    ///< the attenuation along each ray
  std::vector<double> m_volumes;  ///< mm³, of each organ in the image
};

template <class F>
double millisecondsOf(F&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

void run(const Options& options) {
  XRay image(options);
  std::vector<double> updates, exposures;
  for (int frame = 0; frame < options.frames; ++frame) {
    updates.push_back(millisecondsOf([&] { image.move(frame); }));
    exposures.push_back(millisecondsOf([&] { image.expose(); }));
    image.check(frame);
  }
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
  };
  makeFolder(options.out);
  const std::filesystem::path file = options.out / "scene.pgm";
  writeWhole(file, image.picture());
  std::printf("%d x %d pixels of %.2g mm, 5 organs of %zu triangles, %d images\n", options.pixels,
              options.pixels, kWidth / options.pixels, image.triangles(), options.frames);
  std::printf("image ms %.2f, organs moved ms %.2f, budget ms %.1f\n", median(exposures),
              median(updates), kBudget);
  std::printf("written: %s\n", file.string().c_str());
}

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  Options options;
  CLI::App app("X-ray images of organs that breathe.", "XRay");
  app.add_option("--frames", options.frames, "images to compute")->check(CLI::PositiveNumber);
  app.add_option("--pixels", options.pixels, "width and height")->check(between(16, 4096));
  app.add_option("--threads", options.threads, "0: all cores")->check(CLI::NonNegativeNumber);
  app.add_option("--out", options.out, "the folder for the last image, scene.pgm");
  return exitCodeOf(app, [&] {
    app.parse(count, arguments);
    run(options);
    return true;
  });
}
