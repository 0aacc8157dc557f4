#include "SceneProgram.h"

#include "CommandLine.h"
#include "HtmlReport.h"
#include "ParaView.h"
#include "WriteFile.h"

#include <palpate/Error.h>
#ifdef PALPATE_HAS_MESH_FILES
#include <palpate/MeshFiles.h>
#endif
#ifdef PALPATE_HAS_VTK
#include <palpate/vtk/Window.h>
#endif

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <optional>
#include <thread>
#include <unistd.h>

namespace palpate::scenes {

namespace {

struct Options {
  int frames;
  std::filesystem::path out = "out";
  int threads = 0;
  bool paraView = false;
  bool view = false;
  std::vector<int> pictures{};  // the first frame to draw, and the step from picture to picture
  std::array<int, 2> size{1600, 1000};
  std::string keys{};
};

struct Column {
  std::string name;
  std::vector<double> values;
  bool isTime;
};

/// The figures of a run: a value for each column and frame.
class RunLog {
 public:
  void add(const std::string& name, double value, bool isTime = false) {
    const auto column = std::find_if(m_columns.begin(), m_columns.end(),
                                     [&](const Column& c) { return c.name == name; });
    if (column != m_columns.end())
      column->values.push_back(value);
    else
      m_columns.push_back({name, {value}, isTime});
  }
  const std::vector<Column>& columns() const { return m_columns; }

  std::string csv() const {
    std::vector<report::Quantity> quantities;
    for (const Column& column : m_columns) quantities.push_back({column.name, column.name});
    report::Figures figures({"frame"}, quantities);
    for (std::size_t frame = 0; frame < m_columns.front().values.size(); ++frame) {
      report::Figures::Row row{{std::to_string(frame)}, {}};
      for (const Column& column : m_columns) row.values.push_back(column.values[frame]);
      figures.add(std::move(row));
    }
    return figures.csv();
  }

 private:
  std::vector<Column> m_columns;
};

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

std::string summary(const RunLog& log, const SceneProgram& program) {
  std::array<char, 256> line;
  std::string text;
  const auto add = [&](const char* format, auto... values) {
    text.append(line.data(), std::snprintf(line.data(), line.size(), format, values...));
  };
  add("%-20s %10s %10s %10s %10s\n", "", "median", "p99", "worst", "budget");
  for (const Column& column : log.columns()) {
    const double budget = column.name == "frame ms"       ? program.frameMilliseconds
                          : column.name == "collision ms" ? program.collisionMilliseconds
                                                          : 0;
    add("%-20s %10.3f %10.3f %10.3f", column.name.c_str(), quantile(column.values, 0.5),
        quantile(column.values, 0.99), quantile(column.values, 1));
    budget > 0 ? add(" %10.3f\n", budget) : add("\n");
  }
  return text;
}

/// Rows of the page: a group for the times, their histogram, and each other column.
report::Figures pageFigures(const RunLog& log) {
  report::Figures figures({"shown", "series", "frame"},
                          {{"x", "frame (histogram: ms)"}, {"y", "value (histogram: frames)"}});
  for (const Column& column : log.columns()) {
    for (std::size_t frame = 0; frame < column.values.size(); ++frame)
      figures.add({{column.isTime ? "times in ms" : column.name, column.name,
                    "frame " + std::to_string(frame)},
                   {static_cast<double>(frame), column.values[frame]}});
    if (column.name != "frame ms") continue;
    constexpr int kBins = 30;
    const double width = quantile(column.values, 1) / kBins;
    std::vector<double> bins(kBins + 1, 0.0);
    for (const double value : column.values) ++bins[static_cast<std::size_t>(value / width)];
    for (int bin = 0; bin <= kBins; ++bin)
      figures.add({{"histogram", "frames", report::shortNumber((bin + 0.5) * width) + " ms"},
                   {(bin + 0.5) * width, bins[bin]}});
  }
  return figures;
}

std::string machine() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name"))
      return line.substr(line.find(':') + 2) + ", " +
             std::to_string(std::thread::hardware_concurrency()) + " threads";
  }
  return "unknown";
}

std::string page(const RunLog& log, const SceneProgram& program, const Options& options,
                 const std::string& settings, std::uint64_t hash, const std::string& png) {
  std::array<char, 32> hashText;
  std::snprintf(hashText.data(), hashText.size(), "%016" PRIx64, hash);
  report::View view{
      .title = program.name,
      .paragraphs = {program.description,
                     "Settings: " + std::to_string(options.frames) + " frames, threads " +
                         (options.threads == 0 ? "all" : std::to_string(options.threads)) +
                         (settings.empty() ? "" : ", " + settings) + ". Machine: " + machine() +
                         ". Hash of all contacts: " + hashText.data()},
      .group = "shown",
      .series = "series",
      .label = "frame",
      .first = "times in ms",
      .x = "x",
      .y = "y",
      .lines = true,
      .logX = false};
  if (!png.empty()) view.pictures.push_back(png);
  return report::toHtml(pageFigures(log), view);
}

#ifdef PALPATE_HAS_VTK
/// The picture of the frame's end.
void place(World& world) {
  for (World::BodyId id = 0; id < world.bodies().size(); ++id)
    if (const World::Body& body = world.bodies()[id]; body.count > 0 && body.rest.empty())
      world.detection().setPositions(body.id, world.positions(id));
}
#endif

#ifdef PALPATE_HAS_VTK
void prepare(vtk::Window& window, LiveScene& scene, const SceneProgram& program,
             const Options& options) {
  for (const BodyLook& look : scene.looks())
    window.setAppearance(scene.world().bodies()[look.body].id,
                         {look.label, look.colour, look.opacity, look.frontFaces},
                         look.firstElement);
  const PictureView view = scene.view();
  window.setView({.from = view.from, .centre = view.centre, .height = view.height});
  window.setLengthUnit(program.unit);
  for (const char key : program.keys + options.keys) window.press(key);
}

/// An image of half the width and height: the mean of each four pixels.
vtk::Image halved(const vtk::Image& image) {
  vtk::Image half{image.width / 2, image.height / 2, {}};
  half.rgb.resize(static_cast<std::size_t>(3) * half.width * half.height);
  for (int y = 0; y < half.height; ++y) {
    for (int i = 0; i < 3 * half.width; ++i) {
      const std::size_t at = static_cast<std::size_t>(6) * y * image.width + 6 * (i / 3) + i % 3,
                        above = at + static_cast<std::size_t>(3) * image.width;
      const int sum = image.rgb[at] + image.rgb[at + 3] + image.rgb[above] + image.rgb[above + 3];
      half.rgb[static_cast<std::size_t>(3) * y * half.width + i] =
          static_cast<std::uint8_t>((sum + 2) / 4);
    }
  }
  return half;
}

/// Draws pictures off screen, at twice their size, so that edges are smooth.
class Painter {
 public:
  Painter(LiveScene& scene, const SceneProgram& program, const Options& options)
      : m_scene(scene),
        m_window(scene.world().detection(), false, 2 * options.size[0], 2 * options.size[1]) {
    prepare(m_window, scene, program, options);
  }
  std::string png() {
    place(m_scene.world());
    m_window.show();
    return vtk::toPng(halved(m_window.image()));
  }

 private:
  LiveScene& m_scene;
  vtk::Window m_window;
};
#endif

/// Prints the reason if there is none.
std::string picture([[maybe_unused]] LiveScene& scene, [[maybe_unused]] const SceneProgram& program,
                    [[maybe_unused]] const Options& options) {
#ifdef PALPATE_HAS_VTK
  try {
    return Painter(scene, program, options).png();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::NotAvailable) throw;
    std::printf("no picture           %s\n", error.what());
  }
#else
  std::printf("no picture           built without VTK\n");
#endif
  return "";
}

std::uint64_t nextHash(std::uint64_t hash, World& world) {
  for (const World::Pair& pair : world.pairs())
    hash = (hash ^ world.contacts(pair.a, pair.b).hash()) * 0x100000001b3u;
  return hash;
}

void logFrame(RunLog& log, LiveScene& scene, double milliseconds) {
  const World::Times& times = scene.world().times();
  log.add("frame ms", milliseconds, true);
  log.add("collision ms", times.collision, true);
  log.add("boxes ms", times.boxes, true);
  log.add("octree ms", times.octree, true);
  log.add("pairs ms", times.pairs, true);
  log.add("narrow phase ms", times.narrowPhase, true);
  log.add("order ms", times.order, true);
  log.add("hold ms", times.hold, true);
  log.add("solver ms", times.solver, true);
  log.add("contacts", static_cast<double>(times.contacts));
  log.add("held particles", static_cast<double>(times.held));
  for (const auto& [name, value] : scene.values()) log.add(name, value);
}

void run(const SceneProgram& program, Options options) {
  const std::unique_ptr<LiveScene> scene = program.make(options.threads);
#ifdef PALPATE_HAS_VTK
  std::optional<vtk::Window> window;
  if (options.view) prepare(window.emplace(scene->world().detection()), *scene, program, options);
  std::optional<Painter> painter;
  if (!options.pictures.empty()) painter.emplace(*scene, program, options);
#endif
  makeFolder(options.out);
  if (!options.pictures.empty()) makeFolder(options.out / "pictures");
  std::optional<ParaViewSeries> series;
  if (options.paraView) series.emplace(options.out / "paraview");
  RunLog log;
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (int frame = 0; frame < options.frames; ++frame) {
    scene->world().resetTimes();
    const auto start = std::chrono::steady_clock::now();
    scene->computeFrame(frame);
    const std::chrono::duration<double, std::milli> passed =
        std::chrono::steady_clock::now() - start;
    const std::string fault = scene->fault();
    if (!fault.empty())
      throw Error(ErrorCode::NotAvailable, "Frame " + std::to_string(frame) + ": " + fault);
    logFrame(log, *scene, passed.count());
    hash = nextHash(hash, scene->world());
    if (series) series->add(scene->world());
#ifdef PALPATE_HAS_VTK
    if (window) place(scene->world());
    if (window && !window->show()) options.frames = frame + 1;
    if (painter && frame >= options.pictures[0] &&
        (frame - options.pictures[0]) % std::max(1, options.pictures[1]) == 0) {
      std::array<char, 32> name;
      std::snprintf(name.data(), name.size(), "%06d.png", frame);
      writeWhole(options.out / "pictures" / name.data(), painter->png());
    }
#endif
  }
  const std::string settings = scene->settings();
  std::printf("%s, %d frames%s%s\n%s", program.name.c_str(), options.frames,
              settings.empty() ? "" : ", ", settings.c_str(), summary(log, program).c_str());
  std::printf("%-20s %016" PRIx64 "\n", "result hash", hash);
  if (series) series->finish(program.name);
  std::unique_ptr<LiveScene> still;  // whose octrees are built for its very frame
  if (const std::optional<int> frame = scene->frameToShow()) {
    still = program.make(options.threads);
    still->computeFrame(*frame);
  }
  const std::string png = picture(*(still ? still : scene), program, options);
  if (!png.empty()) {
    writeWhole(options.out / "scene.png", png);
    std::printf("%-20s %s\n", "picture", (options.out / "scene.png").c_str());
  }
  writeWhole(options.out / "frames.csv", log.csv());
  writeWhole(options.out / "report.html", page(log, program, options, settings, hash, png));
  std::printf("%-20s %s\n", "report", (options.out / "report.html").c_str());
}

}  // namespace

int runScene(const SceneProgram& program, int count, char** arguments) {
  CLI::App app(program.description, program.name);
  Options options{.frames = program.frames};
  app.add_option("--frames", options.frames, "frames to compute")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--out", options.out, "folder for frames.csv, report.html and scene.png")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--paraview", options.paraView,
               "also write OUT/paraview: .vtp files of bodies, contacts and octree, and a .pvd");
#ifdef PALPATE_HAS_VTK
  app.add_flag("--view", options.view,
               "shows each frame in a window; keys: o cells, b translucent bodies, c contacts, n "
               "normals, u untrusted, l names, p panel, t times, r all in view, space waits, q "
               "closes; a click names the element");
  app.add_option("--pictures", options.pictures,
                 "also write OUT/pictures: a picture of the frame FIRST, and of each STEP-th frame "
                 "from there")
      ->type_name("FIRST STEP")
      ->expected(2)
      ->check(CLI::Range(0, 1'000'000));
  app.add_option("--size", options.size, "width and height of pictures, in pixels")
      ->check(CLI::Range(1, 8192))
      ->capture_default_str();
  app.add_option("--keys", options.keys, "keys of the window, pressed before it shows anything");
#endif
  if (program.addOptions) program.addOptions(app);
  app.failure_message(
      [](const CLI::App*, const CLI::Error& error) { return std::string(error.what()) + "\n"; });
  return exitCodeOf(app, [&] {
    app.parse(count, arguments);
    run(program, options);
  });
}

SceneMesh readMesh([[maybe_unused]] const std::filesystem::path& path) {
#ifdef PALPATE_HAS_MESH_FILES
  MeshReadSettings settings;
  if (path.extension() == ".stl") settings.weldDistance = 0.0;  // its triangles share no vertices
  MeshArrays file = readMeshFile(path, settings);
  return {std::move(file.positions), std::move(file.triangles)};
#else
  throw Error(
      ErrorCode::NotAvailable,
      "This program was built without mesh files and cannot read \"" + path.string() + "\".");
#endif
}

}  // namespace palpate::scenes
