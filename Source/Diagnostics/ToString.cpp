// Part of <palpate/Palpate.h>: the names of enumerators. A switch without a default has the
// compiler check that none is missing.
#include <palpate/Capture.h>
#include <palpate/FeaturePairs.h>
#include <palpate/LooseOctree.h>
#include <palpate/Meshes.h>
#include <palpate/Palpate.h>

namespace palpate {

/// For a value that is no enumerator.
static constexpr const char* kUnknown = "unknown";

const char* toString(AuditFailure::Fault value) noexcept {
  switch (value) {
    case AuditFailure::Fault::FalseNegative:
      return "FalseNegative";
    case AuditFailure::Fault::FalsePositive:
      return "FalsePositive";
    case AuditFailure::Fault::Different:
      return "Different";
  }
  return kUnknown;
}

const char* toString(AuditFailure::List value) noexcept {
  switch (value) {
    case AuditFailure::List::VertexTriangle:
      return "VertexTriangle";
    case AuditFailure::List::TriangleVertex:
      return "TriangleVertex";
    case AuditFailure::List::EdgeEdge:
      return "EdgeEdge";
    case AuditFailure::List::IntersectingTriangles:
      return "IntersectingTriangles";
    case AuditFailure::List::Earliest:
      return "Earliest";
    case AuditFailure::List::Shape:
      return "Shape";
    case AuditFailure::List::ShapeShape:
      return "ShapeShape";
  }
  return kUnknown;
}

const char* toString(InsideRule value) noexcept {
  switch (value) {
    case InsideRule::Closed:
      return "Closed";
    case InsideRule::WindingNumber:
      return "WindingNumber";
  }
  return kUnknown;
}

const char* toString(ShapeElement value) noexcept {
  switch (value) {
    case ShapeElement::Vertex:
      return "Vertex";
    case ShapeElement::Edge:
      return "Edge";
    case ShapeElement::Face:
      return "Face";
  }
  return kUnknown;
}

const char* toString(TriangleFeature value) noexcept {
  switch (value) {
    case TriangleFeature::CornerA:
      return "CornerA";
    case TriangleFeature::CornerB:
      return "CornerB";
    case TriangleFeature::CornerC:
      return "CornerC";
    case TriangleFeature::EdgeAB:
      return "EdgeAB";
    case TriangleFeature::EdgeBC:
      return "EdgeBC";
    case TriangleFeature::EdgeCA:
      return "EdgeCA";
    case TriangleFeature::Face:
      return "Face";
  }
  return kUnknown;
}

const char* toString(EdgeFeature value) noexcept {
  switch (value) {
    case EdgeFeature::Start:
      return "Start";
    case EdgeFeature::End:
      return "End";
    case EdgeFeature::Interior:
      return "Interior";
  }
  return kUnknown;
}

const char* toString(ErrorCode value) noexcept {
  switch (value) {
    case ErrorCode::NonFinitePosition:
      return "NonFinitePosition";
    case ErrorCode::WrongPositionCount:
      return "WrongPositionCount";
    case ErrorCode::IndexOutOfRange:
      return "IndexOutOfRange";
    case ErrorCode::UnknownGeometry:
      return "UnknownGeometry";
    case ErrorCode::UnknownPair:
      return "UnknownPair";
    case ErrorCode::DuplicatePair:
      return "DuplicatePair";
    case ErrorCode::InvalidSettings:
      return "InvalidSettings";
    case ErrorCode::NotClosed:
      return "NotClosed";
    case ErrorCode::UnsupportedMethod:
      return "UnsupportedMethod";
    case ErrorCode::TooLarge:
      return "TooLarge";
    case ErrorCode::NotAvailable:
      return "NotAvailable";
    case ErrorCode::File:
      return "File";
    case ErrorCode::InvalidRadius:
      return "InvalidRadius";
    case ErrorCode::InvalidShape:
      return "InvalidShape";
    case ErrorCode::InvalidTransform:
      return "InvalidTransform";
    case ErrorCode::SharedFace:
      return "SharedFace";
    case ErrorCode::InvalidCall:
      return "InvalidCall";
    case ErrorCode::ImpactRemains:
      return "ImpactRemains";
    case ErrorCode::MemoryLimit:
      return "MemoryLimit";
    case ErrorCode::Cancelled:
      return "Cancelled";
  }
  return kUnknown;
}

const char* toString(LooseOctree::Update value) noexcept {
  switch (value) {
    case LooseOctree::Update::Rebuilt:
      return "Rebuilt";
    case LooseOctree::Update::Refitted:
      return "Refitted";
    case LooseOctree::Update::Unchanged:
      return "Unchanged";
  }
  return kUnknown;
}

const char* toString(DirectionChange value) noexcept {
  switch (value) {
    case DirectionChange::Entered:
      return "Entered";
    case DirectionChange::None:
      return "None";
    case DirectionChange::Kept:
      return "Kept";
    case DirectionChange::Jumped:
      return "Jumped";
  }
  return kUnknown;
}

const char* toString(OctreeUpdate value) noexcept {
  switch (value) {
    case OctreeUpdate::Auto:
      return "Auto";
    case OctreeUpdate::Rebuild:
      return "Rebuild";
  }
  return kUnknown;
}

const char* toString(OctreeBounds value) noexcept {
  switch (value) {
    case OctreeBounds::Box:
      return "Box";
    case OctreeBounds::Dop14:
      return "Dop14";
    case OctreeBounds::Dop18:
      return "Dop18";
  }
  return kUnknown;
}

const char* toString(Engine value) noexcept {
  switch (value) {
    case Engine::Octree:
      return "Octree";
    case Engine::BruteForce:
      return "BruteForce";
  }
  return kUnknown;
}

const char* toString(Method value) noexcept {
  switch (value) {
    case Method::Auto:
      return "Auto";
    case Method::Intersection:
      return "Intersection";
    case Method::Proximity:
      return "Proximity";
    case Method::Continuous:
      return "Continuous";
    case Method::DistanceField:
      return "DistanceField";
    case Method::Proxy:
      return "Proxy";
  }
  return kUnknown;
}

const char* toString(Contacts value) noexcept {
  switch (value) {
    case Contacts::Distinct:
      return "Distinct";
    case Contacts::All:
      return "All";
  }
  return kUnknown;
}

const char* toString(Sidedness value) noexcept {
  switch (value) {
    case Sidedness::Both:
      return "Both";
    case Sidedness::Outer:
      return "Outer";
  }
  return kUnknown;
}

const char* toString(ContactFeatures::Kind value) noexcept {
  switch (value) {
    case ContactFeatures::Kind::VertexTriangle:
      return "VertexTriangle";
    case ContactFeatures::Kind::TriangleVertex:
      return "TriangleVertex";
    case ContactFeatures::Kind::EdgeEdge:
      return "EdgeEdge";
  }
  return kUnknown;
}

const char* toString(ContactKind value) noexcept {
  switch (value) {
    case ContactKind::VertexTriangle:
      return "VertexTriangle";
    case ContactKind::TriangleVertex:
      return "TriangleVertex";
    case ContactKind::EdgeEdge:
      return "EdgeEdge";
    case ContactKind::Shape:
      return "Shape";
    case ContactKind::ShapeShape:
      return "ShapeShape";
  }
  return kUnknown;
}

const char* toString(ContactEnd value) noexcept {
  switch (value) {
    case ContactEnd::None:
      return "None";
    case ContactEnd::Cut:
      return "Cut";
    case ContactEnd::Disabled:
      return "Disabled";
    case ContactEnd::Filtered:
      return "Filtered";
    case ContactEnd::Apart:
      return "Apart";
  }
  return kUnknown;
}

const char* toString(ThreadEvent::Cause value) noexcept {
  switch (value) {
    case ThreadEvent::Cause::Passed:
      return "Passed";
    case ThreadEvent::Cause::EndPassed:
      return "EndPassed";
    case ThreadEvent::Cause::Set:
      return "Set";
    case ThreadEvent::Cause::Cut:
      return "Cut";
    case ThreadEvent::Cause::Disabled:
      return "Disabled";
  }
  return kUnknown;
}

const char* toString(GeometryType value) noexcept {
  switch (value) {
    case GeometryType::Triangles:
      return "Triangles";
    case GeometryType::Lines:
      return "Lines";
    case GeometryType::Points:
      return "Points";
    case GeometryType::Shape:
      return "Shape";
    case GeometryType::Field:
      return "Field";
  }
  return kUnknown;
}

const char* toString(MethodReason value) noexcept {
  switch (value) {
    case MethodReason::Requested:
      return "Requested";
    case MethodReason::Still:
      return "Still";
    case MethodReason::Slow:
      return "Slow";
    case MethodReason::Fast:
      return "Fast";
    case MethodReason::Mixed:
      return "Mixed";
    case MethodReason::Cheapest:
      return "Cheapest";
    case MethodReason::NoAlternative:
      return "NoAlternative";
    case MethodReason::AllowedError:
      return "AllowedError";
    case MethodReason::OutOfTime:
      return "OutOfTime";
  }
  return kUnknown;
}

}  // namespace palpate
