#include "Queries/ClosedBody.h"

#include <palpate/Error.h>

#include "Queries/Containment.h"
#include "Bodies/InputChecks.h"
#include "Math/Range.h"
#include "Core/Text.h"

#include <string>

namespace palpate {

void makeClosedBody(const TriangleMeshView& mesh, const Threads& threads, Body& out) {
  makeCheckedBody(mesh, threads, out);
  checkInside(out, InsideRule::Closed);
}

void makeCheckedBody(const TriangleMeshView& mesh, const Threads& threads, Body& out) {
  checkCounts(out, mesh.positions.size(), mesh.triangles, GeometryType::Triangles);
  const CountedVector<Eigen::Vector3d> positions = checkedRest(out, mesh.positions);
  if (mesh.triangles.empty())
    throw Error(ErrorCode::NotClosed, nameOf(out) + " has no triangles", out.id);
  makeBody(positions, mesh.triangles, threads, out);
}

void checkPositive(double length, const char* name) {
  if (!(length > 0.0) || !isWithinRange(length))
    throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " + textOf(length) +
                                                "; it must be positive and at most 1e+300");
}

}  // namespace palpate
