#include "RunReport.h"

#include "ContactPoints.h"
#include "Page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace palpate::scenes {

using Eigen::Vector3d;
using report::Json;

namespace {

/// The content of palpate/_report.html, which CMake inserts.
constexpr std::string_view kPage =
#include "RunReportPage.inc"
    ;

constexpr std::size_t kMostBytes = 7'500'000, kMostTriangles = 60'000, kMostPoints = 10'000,
                      kMostContacts = 4'000;

constexpr std::uint32_t kDigits = 92, kSteps = kDigits * kDigits - 1;

/// Numbers as text of the page, which reads them by numbersOf(): their width as a digit, then as
/// many digits of each, to the base of all printable characters that JSON and HTML do not escape.
std::string digitsOf(const std::vector<std::uint32_t>& values) {
  std::uint32_t width = 1;
  if (!values.empty())
    for (auto most = *std::max_element(values.begin(), values.end()); most /= kDigits;) ++width;
  std::string text(1 + width * values.size(), static_cast<char>(width));
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::uint32_t rest = values[i];
    for (std::size_t at = width; at-- > 0; rest /= kDigits)
      text[1 + i * width + at] = static_cast<char>(rest % kDigits);
  }
  for (char& digit : text) {
    digit = static_cast<char>(digit + ' ');
    for (const char skipped : {'"', '<', '\\'})
      digit = static_cast<char>(digit + (digit >= skipped));
  }
  return text;
}

/// A share of [0, 1] in two digits.
std::uint32_t stepsOf(double share) {
  return static_cast<std::uint32_t>(std::lround(kSteps * std::clamp(share, 0.0, 1.0)));
}
/// Where a point is in a box.
void putSteps(std::vector<std::uint32_t>& steps, const Vector3d& p,
              const Eigen::AlignedBox3d& box) {
  for (int i = 0; i < 3; ++i) {
    const double size = box.sizes()[i];
    steps.push_back(size > 0 ? stepsOf((p[i] - box.min()[i]) / size) : 0);
  }
}

/// Six significant digits: a page is text.
double rounded(double value) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return std::strtod(text.data(), nullptr);
}

Json numbers(std::initializer_list<Vector3d> vectors) {
  Json list = Json::array();
  for (const Vector3d& v : vectors)
    for (const double x : v) list.push_back(rounded(x));
  return list;
}

const char* shapeOf(GeometryType type) {
  return type == GeometryType::Lines    ? "lines"
         : type == GeometryType::Points ? "points"
                                        : "triangles";
}
const char* elementOf(GeometryType type) {
  return type == GeometryType::Lines    ? "segment"
         : type == GeometryType::Points ? "point"
                                        : "triangle";
}

/// A body as the page shows it.
struct ShownBody {
  std::vector<std::uint32_t> vertices;  ///< those that are shown
  std::vector<std::uint32_t> elements;  ///< two or three of them each
  bool isWhole = true;
};

std::vector<std::uint32_t> cornersOf(std::span<const Triangle> triangles) {
  std::vector<std::uint32_t> corners;
  for (const Triangle& t : triangles) corners.insert(corners.end(), t.begin(), t.end());
  return corners;
}

/// Joins the vertices in each cell of a grid whose cells are as small as the triangles' number
/// permits.
void simplify(ShownBody& body, std::span<const Vector3d> positions) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  const std::vector<std::uint32_t> all = body.elements;
  for (double cells = 256; body.elements.size() > 3 * kMostTriangles; cells *= 0.8) {
    const double size = box.sizes().maxCoeff() / cells;
    std::map<std::array<int, 3>, std::uint32_t> firsts;
    body.vertices.clear();
    std::vector<std::uint32_t> shown(positions.size());
    for (std::uint32_t v = 0; v < positions.size(); ++v) {
      const Vector3d cell = (positions[v] - box.min()) / size;
      const auto [at, isNew] = firsts.try_emplace(
          {static_cast<int>(cell.x()), static_cast<int>(cell.y()), static_cast<int>(cell.z())},
          static_cast<std::uint32_t>(body.vertices.size()));
      if (isNew) body.vertices.push_back(v);
      shown[v] = at->second;
    }
    body.elements.clear();
    for (std::size_t t = 0; t < all.size(); t += 3) {
      const std::uint32_t a = shown[all[t]], b = shown[all[t + 1]], c = shown[all[t + 2]];
      if (a != b && b != c && c != a) body.elements.insert(body.elements.end(), {a, b, c});
    }
    body.isWhole = false;
  }
}

}  // namespace

struct RunReport::Implementation {
  struct Placed {
    const std::string* block;
    Vector3d low, size;
    const std::string* elements;  ///< null: those of the first frame
    std::optional<Pose> pose;
  };
  struct Cells {
    World::BodyId body;
    const std::string* block;
    Vector3d low;  ///< of the root, whose size is that of its side
    double size;
  };
  struct Frame {
    int number;
    std::vector<Placed> bodies;
    std::vector<Cells> cells;
    std::vector<std::pair<World::BodyId, const std::string*>> untrusted;  ///< vertices
    const std::string *contacts, *ids;
    Eigen::AlignedBox3d box;  ///< of the contacts
    double least, most;       ///< distances
    struct Pair {
      const char* method;
      bool trusted;
      std::size_t contacts;
    };
    std::vector<Pair> pairs;
    template <class F>
    void forEachBlock(F&& f) const {
      for (const Placed& body : bodies) {
        f(body.block);
        if (body.elements != nullptr) f(body.elements);
      }
      for (const Cells& part : cells) f(part.block);
      for (const auto& [body, block] : untrusted) f(block);
      f(contacts);
      f(ids);
    }
  };

  PictureView view;
  std::vector<ShownBody> shown;
  Json bodies = Json::array(), pairs = Json::array(), notes = Json::array();
  std::map<std::string, int> uses;  ///< of each block
  std::size_t bytes = 0;
  int stride = 1;
  bool hasMoreContacts = false;
  std::vector<Frame> frames;

  const std::string* keep(const std::vector<std::uint32_t>& numbers) {
    const auto [block, isNew] = uses.try_emplace(digitsOf(numbers), 0);
    if (isNew) bytes += block->first.size();
    ++block->second;
    return &block->first;
  }
  void release(const std::string* text) {
    const auto block = uses.find(*text);
    if (--block->second > 0) return;
    bytes -= text->size();
    uses.erase(block);
  }
  void dropFramesBut(const std::set<int>& worst) {
    std::erase_if(frames, [&](const Frame& frame) {
      if (frame.number % stride == 0 || worst.contains(frame.number)) return false;
      frame.forEachBlock([this](const std::string* block) { release(block); });
      return true;
    });
  }

  void addBody(World&, World::BodyId, const BodyLook*);
  Placed place(World&, World::BodyId);
  std::vector<Cells> cellsOf(World&);
  void addContacts(World&, Frame&);
};

void RunReport::Implementation::addBody(World& world, World::BodyId id, const BodyLook* look) {
  const World::Body& body = world.bodies()[id];
  const bool isShape = body.type == GeometryType::Shape;
  const std::span<const Vector3d> positions =
      isShape ? std::span<const Vector3d>(body.drawn.positions) : world.positions(id);
  ShownBody& part = shown.emplace_back();
  for (std::uint32_t v = 0; v < positions.size(); ++v) part.vertices.push_back(v);
  part.elements = cornersOf(isShape ? body.drawn.triangles : body.triangles);
  for (const Segment& s : body.segments)
    part.elements.insert(part.elements.end(), s.begin(), s.end());
  const std::string name = look && !look->label.empty() ? look->label : body.name;
  if (body.segments.empty() && part.elements.size() > 3 * kMostTriangles) {
    const std::size_t triangles = part.elements.size() / 3;
    simplify(part, positions);
    notes.push_back(name + ": simplified from " + std::to_string(triangles) + " to " +
                    std::to_string(part.elements.size() / 3) + " triangles.");
  }
  if (part.elements.empty() && positions.size() > kMostPoints) {
    const std::size_t each = positions.size() / kMostPoints + 1;
    std::erase_if(part.vertices, [each](std::uint32_t v) { return v % each != 0; });
    part.isWhole = false;
    notes.push_back(name + ": one of " + std::to_string(each) + " points is shown.");
  }
  Json json{{"name", name},
            {"shape", shapeOf(body.type)},
            {"element", elementOf(body.type)},
            {"ids", part.isWhole && !isShape},
            {"colour", look ? look->colour : kSteelColour},
            {"opacity", look ? look->opacity : 1.0},
            {"inside", look && !look->frontFaces},
            {"radius", body.radius}};
  if (!part.elements.empty()) json["elements"] = *keep(part.elements);
  bodies.push_back(std::move(json));
}

RunReport::Implementation::Placed RunReport::Implementation::place(World& world, World::BodyId id) {
  const World::Body& body = world.bodies()[id];
  const bool isShape = body.type == GeometryType::Shape, isRigid = isShape || !body.rest.empty();
  const std::span<const Vector3d> positions = isShape ? std::span(body.drawn.positions)
                                              : isRigid
                                                  ? std::span(body.rest)
                                                  : std::span<const Vector3d>(world.positions(id));
  ShownBody& part = shown[id];
  const std::string* elements = nullptr;
  if (part.isWhole && !body.triangles.empty()) {  // cuts add vertices and change triangles
    for (auto v = static_cast<std::uint32_t>(part.vertices.size()); v < positions.size(); ++v)
      part.vertices.push_back(v);
    const std::vector<std::uint32_t> corners = cornersOf(body.triangles);
    if (corners != part.elements) elements = keep(corners);
  }
  Eigen::AlignedBox3d box;
  for (const std::uint32_t v : part.vertices) box.extend(positions[v]);
  if (box.isEmpty()) box.extend(Vector3d::Zero());
  std::vector<std::uint32_t> steps;
  for (const std::uint32_t v : part.vertices) putSteps(steps, positions[v], box);
  Placed placed{keep(steps), box.min(), box.sizes(), elements, {}};
  if (isRigid) placed.pose = Pose{body.rotation, body.translation};
  return placed;
}

/// Cells with elements, each as its place among the cells of its depth, and the depth.
std::vector<RunReport::Implementation::Cells> RunReport::Implementation::cellsOf(World& world) {
  std::vector<Cells> all;
  const LooseOctree& octree = world.detection().octree();
  for (World::BodyId id = 0; id < world.bodies().size(); ++id) {
    if (!shown[id].isWhole) continue;
    std::vector<std::uint32_t> cells;
    Eigen::AlignedBox3d root;
    for (const LooseOctree::Node& node : octree.nodes(world.bodies()[id].id)) {
      if (node.depth == 0) root = node.bounds;
      if (node.elements.empty()) continue;
      const Vector3d steps = (node.bounds.center() - root.min()) / node.bounds.sizes().x();
      for (const double step : steps) cells.push_back(static_cast<std::uint32_t>(step));
      cells.push_back(static_cast<std::uint32_t>(node.depth));
    }
    if (!cells.empty()) all.push_back({id, keep(cells), root.min(), root.sizes().x()});
  }
  return all;
}

/// 13 numbers and 4 ids of each, as contactsOf() of the page reads them.
void RunReport::Implementation::addContacts(World& world, Frame& frame) {
  std::vector<ContactPoint> points = contactPoints(world);
  for (const ContactPoint& point : points) ++frame.pairs[point.pair].contacts;
  if (const std::size_t each = points.size() / kMostContacts + 1; each > 1) {
    for (std::size_t i = 0; each * i < points.size(); ++i) points[i] = points[each * i];
    points.resize((points.size() + each - 1) / each);
    hasMoreContacts = true;
  }
  frame.least = frame.most = 0;
  frame.box.extend(Vector3d::Zero());
  for (const ContactPoint& point : points) {
    frame.box.extend(point.at);
    frame.least = std::min(frame.least, point.distance);
    frame.most = std::max(frame.most, point.distance);
  }
  std::vector<std::uint32_t> numbers, ids;
  for (const ContactPoint& point : points) {
    putSteps(numbers, point.at, frame.box);
    for (const double x : point.normal) numbers.push_back(stepsOf((x + 1) / 2));
    numbers.push_back(static_cast<std::uint32_t>(point.kind));
    numbers.push_back(static_cast<std::uint32_t>(point.pair));
    numbers.push_back(stepsOf(point.time));
    for (int i = 0; i < 2; ++i) numbers.push_back(stepsOf(point.weights[i]));
    const double range = frame.most - frame.least;
    const double steps = range > 0 ? (point.distance - frame.least) / range * kSteps : 0;
    numbers.push_back(static_cast<std::uint32_t>(steps));
    numbers.push_back(stepsOf(steps - std::floor(steps)));
    ids.insert(ids.end(), point.ids.begin(), point.ids.end());
  }
  frame.contacts = keep(numbers);
  frame.ids = keep(ids);
}

RunReport::RunReport(World& world, std::span<const BodyLook> looks, const PictureView& view)
    : m_implementation(new Implementation) {
  Implementation& own = *m_implementation;
  own.view = view;
  for (World::BodyId id = 0; id < world.bodies().size(); ++id) {
    const auto look = std::find_if(looks.begin(), looks.end(),
                                   [id](const BodyLook& each) { return each.body == id; });
    own.addBody(world, id, look == looks.end() ? nullptr : &*look);
  }
  for (const World::Pair& pair : world.pairs()) own.pairs.push_back({pair.a, pair.b});
}

RunReport::~RunReport() = default;

void RunReport::add(World& world, int frame, const std::set<int>& worst) {
  Implementation& own = *m_implementation;
  if (frame % own.stride != 0 && !worst.contains(frame)) return;
  Implementation::Frame added{};
  added.number = frame;
  added.cells = own.cellsOf(world);
  for (World::BodyId id = 0; id < world.bodies().size(); ++id)
    added.bodies.push_back(own.place(world, id));
  std::map<World::BodyId, std::set<std::uint32_t>> untrusted;
  for (const World::Pair& pair : world.pairs()) {
    const Validity& validity = world.contacts(pair.a, pair.b).validity();
    added.pairs.push_back({toString(validity.method), validity.trusted, 0});
    for (const auto& [body, vertices] : {std::pair(pair.a, &validity.untrustedVerticesA),
                                         std::pair(pair.b, &validity.untrustedVerticesB)})
      if (own.shown[body].isWhole) untrusted[body].insert(vertices->begin(), vertices->end());
  }
  for (const auto& [body, vertices] : untrusted)
    if (!vertices.empty())
      added.untrusted.emplace_back(body, own.keep({vertices.begin(), vertices.end()}));
  own.addContacts(world, added);
  own.frames.push_back(std::move(added));
  if (own.bytes > kMostBytes) own.dropFramesBut(worst);
  while (own.bytes > kMostBytes && own.frames.size() > worst.size() + 1) {
    own.stride *= 2;
    own.dropFramesBut(worst);
  }
}

std::string RunReport::html(const Text& text, std::span<const Series> series) const {
  const Implementation& own = *m_implementation;
  Json json{{"title", text.title},
            {"paragraphs", text.paragraphs},
            {"worst", {{"at", text.worst}, {"text", text.whyWorst}}}};
  for (std::size_t frame = 0; frame < series.front().values.size(); ++frame)
    json["frames"].push_back(frame);
  for (const Series& each : series) {
    Json values = Json::array();
    for (const double value : each.values) values.push_back(rounded(value));
    json["series"].push_back({{"name", each.name}, {"values", std::move(values)}});
    if (std::isfinite(each.budget)) json["series"].back()["budget"] = rounded(each.budget);
  }
  Json replay{{"unit", text.unit},
              {"from", numbers({own.view.from})},
              {"centre", numbers({own.view.centre})},
              {"height", own.view.height},
              {"pairs", own.pairs},
              {"notes", own.notes},
              {"bodies", own.bodies},
              {"frames", Json::array()},
              {"blocks", Json::array()}};
  std::map<const std::string*, std::size_t> indices;
  const auto indexOf = [&](const std::string* block) {
    const auto [at, isNew] = indices.try_emplace(block, indices.size());
    if (isNew) replay["blocks"].push_back(*block);
    return at->second;
  };
  for (Json& body : replay["bodies"])
    if (body.contains("elements"))
      body["elements"] = indexOf(&own.uses.find(body["elements"].get<std::string>())->first);
  for (const Implementation::Frame& frame : own.frames) {
    Json at{{"at", frame.number},
            {"contacts",
             {{"numbers", indexOf(frame.contacts)},
              {"ids", indexOf(frame.ids)},
              {"box", numbers({frame.box.min(), frame.box.sizes()})},
              {"least", rounded(frame.least)},
              {"most", rounded(frame.most)}}}};
    for (const auto& [block, low, size, elements, pose] : frame.bodies) {
      at["bodies"].push_back({{"block", indexOf(block)}, {"box", numbers({low, size})}});
      if (elements != nullptr) at["bodies"].back()["elements"] = indexOf(elements);
      if (pose)
        at["bodies"].back()["pose"] =
            numbers({pose->rotation.row(0).transpose(), pose->rotation.row(1).transpose(),
                     pose->rotation.row(2).transpose(), pose->translation});
    }
    for (const auto& [body, block, low, size] : frame.cells)
      at["cells"].push_back(
          {{"body", body}, {"block", indexOf(block)}, {"low", numbers({low})}, {"size", size}});
    for (const auto& [body, block] : frame.untrusted)
      at["untrusted"].push_back({{"body", body}, {"block", indexOf(block)}});
    for (const auto& [method, trusted, contacts] : frame.pairs)
      at["pairs"].push_back({{"method", method}, {"trusted", trusted}, {"count", contacts}});
    replay["frames"].push_back(std::move(at));
  }
  if (own.hasMoreContacts)
    replay["notes"].push_back("At most " + std::to_string(kMostContacts) +
                              " contacts of a frame are shown.");
  json["replay"] = std::move(replay);
  return report::filled(report::replaced(std::string(kPage), "{{body}}", ""), json);
}

}  // namespace palpate::scenes
