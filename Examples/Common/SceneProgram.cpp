#include "SceneProgram.h"

#include "CommandLine.h"
#include "Figures.h"
#include "ParaView.h"
#include "Progress.h"
#include "RunReport.h"
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
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
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
  bool stages = false;
  std::vector<int> pictures{};  // the first frame to draw, and the step from picture to picture
  std::array<int, 2> size{1600, 1000};
  std::string keys{}, unit{};
};

/// The figures of a run: a value for each column and frame.
class RunLog {
 public:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  void add(const std::string& name, double value, double budget = kNone) {
    const auto column = std::find_if(m_columns.begin(), m_columns.end(),
                                     [&](const Series& c) { return c.name == name; });
    if (column != m_columns.end())
      column->values.push_back(value);
    else
      m_columns.push_back({name, {value}, budget});
  }
  const std::vector<Series>& columns() const { return m_columns; }
  const Series& column(std::string_view name) const {
    return *std::find_if(m_columns.begin(), m_columns.end(),
                         [name](const Series& column) { return column.name == name; });
  }
  /// The frames in which a column has its largest value.
  std::set<int> worst() const {
    std::set<int> frames;
    for (const Series& column : m_columns) frames.insert(worstOf(column));
    return frames;
  }
  static int worstOf(const Series& column) {
    return static_cast<int>(std::max_element(column.values.begin(), column.values.end()) -
                            column.values.begin());
  }

  std::string csv() const {
    std::vector<report::Quantity> quantities;
    for (const Series& column : m_columns) quantities.push_back({column.name, column.name});
    report::Figures figures({"frame"}, quantities);
    for (std::size_t frame = 0; frame < m_columns.front().values.size(); ++frame) {
      report::Figures::Row row{{std::to_string(frame)}, {}};
      for (const Series& column : m_columns) row.values.push_back(column.values[frame]);
      figures.add(std::move(row));
    }
    return figures.csv();
  }

 private:
  std::vector<Series> m_columns;
};

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

/// A line for each column that is not zero throughout. "!" marks what exceeds the budget. columns:
/// those of the table; empty: all.
std::string summary(const RunLog& log, const std::vector<std::string>& columns) {
  std::array<char, 256> line;
  std::string text, zero;
  const auto add = [&](const char* format, auto... values) {
    text.append(line.data(), std::snprintf(line.data(), line.size(), format, values...));
  };
  add("%-20s %11s %11s %11s %11s\n", "", "median ", "p99 ", "worst ", "budget ");
  for (const Series& column : log.columns()) {
    if (!columns.empty() && std::find(columns.begin(), columns.end(), column.name) == columns.end())
      continue;
    if (std::all_of(column.values.begin(), column.values.end(), [](double v) { return v == 0; })) {
      zero += (zero.empty() ? "" : ", ") + column.name;
      continue;
    }
    add("%-20s", column.name.c_str());
    for (const double share : {0.5, 0.99, 1.0}) {
      const double value = quantile(column.values, share);
      add(" %10.3f%c", value, value > column.budget ? '!' : ' ');
    }
    if (std::isfinite(column.budget)) add(" %10.3f", column.budget);
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  }
  if (!zero.empty()) text += "zero in all frames   " + zero + "\n";
  for (const Series& column : log.columns()) {
    const auto over = std::count_if(column.values.begin(), column.values.end(),
                                    [&](double value) { return value > column.budget; });
    if (over > 0 && column.budget > 0)
      add("%-20s %td of %zu frames exceed %g ms; the worst is frame %d\n", column.name.c_str(),
          over, column.values.size(), column.budget, RunLog::worstOf(column));
  }
  return text;
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

std::string page(const RunReport& report, const RunLog& log, const SceneProgram& program,
                 const Options& options, const std::string& settings,
                 const std::vector<std::string>& findings, std::uint64_t hash) {
  std::array<char, 32> hashText;
  std::snprintf(hashText.data(), hashText.size(), "%016" PRIx64, hash);
  const Series &slowest = log.column("frame ms"), &untrusted = log.column("untrusted pairs"),
               &contacts = log.column("contacts");
  const bool isTrusted = quantile(untrusted.values, 1) == 0;
  int worst = isTrusted ? RunLog::worstOf(slowest) : 0;
  const auto faults = [&](int frame) {
    return std::pair(untrusted.values[frame], contacts.values[frame]);
  };
  for (int frame = 1; !isTrusted && frame < options.frames; ++frame)
    if (faults(frame) > faults(worst)) worst = frame;
  std::vector<std::string> paragraphs{program.description};
  paragraphs.insert(paragraphs.end(), findings.begin(), findings.end());
  paragraphs.push_back("Settings: " + std::to_string(options.frames) + " frames, threads " +
                       (options.threads == 0 ? "all" : std::to_string(options.threads)) +
                       (settings.empty() ? "" : ", " + settings) + ". Machine: " + machine() +
                       ". Hash of all contacts: " + hashText.data());
  return report.html({program.name, std::move(paragraphs), options.unit, worst,
                      isTrusted ? "slowest" : "most pairs not trusted"},
                     log.columns());
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
                         {look.label, look.colour, look.opacity, look.frontFaces, look.roughness,
                          look.metallic, look.isCut},
                         look.firstElement);
  const PictureView view = scene.view();
  window.setView({.from = view.from, .up = view.up, .centre = view.centre, .height = view.height});
  if (view.insetHeight > 0)
    window.setInset({view.inset, view.insetHeight, view.insetLeft, view.insetTop});
  if (view.section) window.setSection(*view.section);
  window.setLengthUnit(options.unit);
  for (const char key : program.keys + options.keys) window.press(key);
}

void addNotes(vtk::Window& window, LiveScene& scene) {
  std::vector<vtk::Note> notes;
  for (const PictureNote& note : scene.notes())
    notes.push_back({note.text, note.at, note.from, note.colour});
  window.setNotes(std::move(notes));
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
  std::string png(int frame) {
    place(m_scene.world());
    addNotes(m_window, m_scene);
    m_window.show(frame);
    return vtk::toPng(halved(m_window.image()));
  }

 private:
  LiveScene& m_scene;
  vtk::Window m_window;
};
#endif

/// Prints the reason if there is none.
std::string picture([[maybe_unused]] LiveScene& scene, [[maybe_unused]] const SceneProgram& program,
                    [[maybe_unused]] const Options& options, [[maybe_unused]] int frame) {
#ifdef PALPATE_HAS_VTK
  try {
    return Painter(scene, program, options).png(frame);
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

void logFrame(RunLog& log, LiveScene& scene, const SceneProgram& program, double milliseconds) {
  const World::Times& times = scene.world().times();
  const auto budget = [](double given) { return given > 0 ? given : RunLog::kNone; };
  log.add("frame ms", milliseconds, budget(program.frameMilliseconds));
  log.add("contacts", static_cast<double>(times.contacts));
  double untrusted = 0;
  for (const World::Pair& pair : scene.world().pairs())
    untrusted += !scene.world().contacts(pair.a, pair.b).validity().trusted;
  log.add("untrusted pairs", untrusted, 0);
  log.add("collision ms", times.collision, budget(program.collisionMilliseconds));
  log.add("boxes ms", times.boxes);
  log.add("octree ms", times.octree);
  log.add("pairs ms", times.pairs);
  log.add("narrow phase ms", times.narrowPhase);
  log.add("order ms", times.order);
  log.add("hold ms", times.hold);
  log.add("solver ms", times.solver);
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
  RunReport report(scene->world(), scene->looks(), scene->view());
  Progress progress(program.name);
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (int frame = 0; frame < options.frames; ++frame) {
    scene->world().resetTimes();
    const auto start = std::chrono::steady_clock::now();
    scene->computeFrame(frame);
    const std::chrono::duration<double, std::milli> passed =
        std::chrono::steady_clock::now() - start;
    const std::string fault = scene->fault();
    if (!fault.empty()) throw BrokenPromise("frame " + std::to_string(frame) + ": " + fault);
    logFrame(log, *scene, program, passed.count());
    report.add(scene->world(), frame, log.worst());
    hash = nextHash(hash, scene->world());
    if (series) series->add(scene->world());
#ifdef PALPATE_HAS_VTK
    if (window) place(scene->world()), addNotes(*window, *scene);
    if (window && !window->show(frame)) options.frames = frame + 1;
    if (painter && frame >= options.pictures[0] &&
        (frame - options.pictures[0]) % std::max(1, options.pictures[1]) == 0) {
      std::array<char, 32> name;
      std::snprintf(name.data(), name.size(), "%06d.png", frame);
      writeWhole(options.out / "pictures" / name.data(), painter->png(frame));
    }
#endif
    progress(frame + 1, options.frames);
  }
  const std::string own = scene->settings(),
                    settings = own + (own.empty() ? "" : ", ") + "lengths in " + options.unit;
  std::printf("%s, %d frames, %s\n%s", program.name.c_str(), options.frames, settings.c_str(),
              summary(log, options.stages ? std::vector<std::string>{} : program.table).c_str());
  std::printf("%-20s %016" PRIx64 "\n", "result hash", hash);
  const std::vector<std::string> findings = scene->findings();
  for (const std::string& finding : findings) std::printf("%s\n", finding.c_str());
  if (series) series->finish(program.name);
  std::unique_ptr<LiveScene> still;  // whose octrees are built for its very frame
  const std::optional<int> chosen = scene->frameToShow();
  if (chosen) {
    still = program.make(options.threads);
    still->computeFrame(*chosen);
  }
  const std::string png =
      picture(*(still ? still : scene), program, options, chosen.value_or(options.frames - 1));
  if (!png.empty()) {
    writeWhole(options.out / "scene.png", png);
    std::printf("%-20s %s\n", "picture", (options.out / "scene.png").c_str());
  }
  writeWhole(options.out / "frames.csv", log.csv());
  writeWhole(options.out / "report.html",
             page(report, log, program, options, settings, findings, hash));
  std::printf("%-20s %s\n", "report", (options.out / "report.html").c_str());
}

}  // namespace

std::vector<PictureNote> forceNotes(const Eigen::Vector3d& at, const Eigen::Vector3d& newtons,
                                    double length) {
  constexpr double kLeast = 0.05;  // N
  const double size = newtons.norm();
  if (size < kLeast) return {};
  std::array<char, 16> text;
  std::snprintf(text.data(), text.size(), "%.1f N", size);
  const Eigen::Vector3d tip = at + length * newtons;
  return {{"", tip, at, kForceColour},
          {text.data(), tip + 0.15 * length * size * newtons / size, {}, kForceColour}};
}

int runScene(const SceneProgram& program, int count, char** arguments) {
  CLI::App app(program.description, program.name);
  Options options{.frames = program.frames, .unit = program.unit};
  app.footer(
      "Exit codes: 0 success; 1 the scene broke its promise; 2 a wrong call, or a file that cannot "
      "be read or written.");
  app.add_option("--frames", options.frames, "frames to compute")
      ->check(between(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--out", options.out, "folder for frames.csv, report.html and scene.png")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "0: all cores")
      ->check(between(0, 1024))
      ->capture_default_str();
  if (program.isUnitFree)
    app.add_option("--unit", options.unit, "the meshes' unit of length, as mm, for texts")
        ->capture_default_str();
  app.add_flag("--paraview", options.paraView,
               "also write OUT/paraview: .vtp files of bodies, contacts and octree, and a .pvd");
  if (!program.table.empty())
    app.add_flag("--stages", options.stages, "print the figures of each stage, too");
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
      ->check(between(0, 1'000'000));
  app.add_option("--size", options.size, "width and height of pictures, in pixels")
      ->type_name("WIDTH HEIGHT")
      ->check(between(1, 8192))
      ->capture_default_str();
  app.add_option("--keys", options.keys, "keys of the window, pressed before it shows anything")
      ->check(CLI::Validator(
          [](std::string& keys) -> std::string {
            const auto unknown = std::find_if_not(keys.begin(), keys.end(), vtk::Window::hasKey);
            return unknown == keys.end() ? "" : std::string("the window has no key ") + *unknown;
          },
          ""));
#endif
  if (program.addOptions) program.addOptions(app);
  return exitCodeOf(app, [&] {
    app.parse(count, arguments);
    run(program, options);
    return true;
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
