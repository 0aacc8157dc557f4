#include "NarrowPhase/NarrowPhase.h"

#include "NarrowPhase/Auto.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Proximity.h"
#include "Core/Assert.h"

namespace palpate {

void findContacts(const MeshPair& pair, std::span<const ElementPair> candidates,
                  ContactBuffers& out) {
  PALPATE_ASSERT(!pair.has(GeometryType::Shape) && !pair.has(GeometryType::Field));
  const Method method = pair.settings.method;
  if (method == Method::Proximity) return findProximity(pair, candidates, out);
  if (method == Method::Intersection) return findIntersections(pair, candidates, out);
  if (method == Method::Continuous) return findContinuous(pair, candidates, out);
  findAuto(pair, candidates, out);
}

}  // namespace palpate
