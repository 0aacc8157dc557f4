// Part of <palpate/Palpate.h>: the names of enumerators.
#include <palpate/Capture.h>
#include <palpate/FeaturePairs.h>
#include <palpate/LooseOctree.h>
#include <palpate/Meshes.h>
#include <palpate/Palpate.h>

#include "Fields/Names.h"

namespace palpate {

const char* toString(AuditFailure::Fault value) noexcept { return nameOfEnumerator(value); }
const char* toString(AuditFailure::List value) noexcept { return nameOfEnumerator(value); }
const char* toString(InsideRule value) noexcept { return nameOfEnumerator(value); }
const char* toString(ShapeElement value) noexcept { return nameOfEnumerator(value); }
const char* toString(TriangleFeature value) noexcept { return nameOfEnumerator(value); }
const char* toString(EdgeFeature value) noexcept { return nameOfEnumerator(value); }
const char* toString(ErrorCode value) noexcept { return nameOfEnumerator(value); }
const char* toString(LooseOctree::Update value) noexcept { return nameOfEnumerator(value); }
const char* toString(DirectionChange value) noexcept { return nameOfEnumerator(value); }
const char* toString(OctreeUpdate value) noexcept { return nameOfEnumerator(value); }
const char* toString(OctreeBounds value) noexcept { return nameOfEnumerator(value); }
const char* toString(Engine value) noexcept { return nameOfEnumerator(value); }
const char* toString(Method value) noexcept { return nameOfEnumerator(value); }
const char* toString(Contacts value) noexcept { return nameOfEnumerator(value); }
const char* toString(Sidedness value) noexcept { return nameOfEnumerator(value); }
const char* toString(ContactFeatures::Kind value) noexcept { return nameOfEnumerator(value); }
const char* toString(ContactKind value) noexcept { return nameOfEnumerator(value); }
const char* toString(ContactEnd value) noexcept { return nameOfEnumerator(value); }
const char* toString(ThreadEvent::Cause value) noexcept { return nameOfEnumerator(value); }
const char* toString(GeometryType value) noexcept { return nameOfEnumerator(value); }
const char* toString(MethodReason value) noexcept { return nameOfEnumerator(value); }

}  // namespace palpate
