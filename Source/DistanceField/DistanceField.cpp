#include <palpate/DistanceField.h>

#include <palpate/Error.h>

#include "DistanceField/FieldBuilder.h"
#include "DistanceField/FieldCells.h"
#include "DistanceField/FieldFile.h"
#include "Queries/ClosedBody.h"
#include "Queries/Containment.h"
#include "Bodies/Body.h"
#include "Bodies/InputChecks.h"
#include "Math/Range.h"
#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Core/Threads.h"

#include <string>
#include <utility>

namespace palpate {

namespace {

void checkPoint(const Eigen::Vector3d& point, const char* name) {
  if (!isWithinRange(point))
    throw Error(ErrorCode::NonFinitePosition,
                std::string(name) + " is " + textOf(point) + "; it must be " + kRangeRule);
}

}  // namespace

DistanceField::DistanceField(std::shared_ptr<const Implementation> implementation)
    : m_implementation(std::move(implementation)) {}

const DistanceField::Implementation& DistanceField::valid() const {
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this DistanceField object was moved from");
  return *m_implementation;
}

DistanceField DistanceField::build(const TriangleMeshView& mesh,
                                   const DistanceFieldSettings& settings) {
  const StandardFloatingPoint standard;
  checkPositive(settings.errorBound, "errorBound");
  checkPositive(settings.band, "band");
  checkThreads(settings.threads);
  const Threads threads(settings.threads);
  Body body(GeometryId{0});
  makeCheckedBody(mesh, threads, body);
  const bool closed = palpate::isClosed(body);
  if (!closed) body.prepared->windingNumbers.update(body, threads);
  return DistanceField(
      std::make_shared<const Implementation>(buildField(body, closed, settings, threads)));
}

bool DistanceField::isClosed() const { return valid().cells.isClosed; }
double DistanceField::errorBound() const { return valid().cells.errorBound; }
double DistanceField::band() const { return valid().cells.band; }
std::size_t DistanceField::cells() const { return valid().cells.leaves.size(); }
std::size_t DistanceField::bytes() const { return sizeof(Implementation) + valid().cells.bytes(); }

double DistanceField::value(const Eigen::Vector3d& point) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  checkPoint(point, "the point");
  return StandardFloatingPoint::evaluated(field.lookup.value(point));
}

bool DistanceField::signIsReliable(const Eigen::Vector3d& point) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  checkPoint(point, "the point");
  return field.lookup.signIsReliable(point);
}

Eigen::Vector3d DistanceField::gradient(const Eigen::Vector3d& point) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  checkPoint(point, "the point");
  return field.lookup.gradient(point);
}

void DistanceField::values(std::span<const Eigen::Vector3d> points, std::span<double> out) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  if (points.size() != out.size())
    throw Error(ErrorCode::InvalidSettings, std::to_string(points.size()) +
                                                " points, but room for " +
                                                std::to_string(out.size()) + " answers");
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!isWithinRange(points[i])) checkPoint(points[i], ("point " + std::to_string(i)).c_str());
  field.lookup.values(points, out.data());
}

void DistanceField::save(const std::filesystem::path& path) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  writeField(field.cells, path);
}

DistanceField DistanceField::load(const std::filesystem::path& path) {
  const StandardFloatingPoint standard;
  return DistanceField(std::make_shared<const Implementation>(readField(path)));
}

}  // namespace palpate
