#pragma once

#include "Validity/Trust.h"
#include "Core/Archive.h"

#include <cstddef>

namespace palpate {

template <class File>
void Trust::describe(File& file, const auto& revisions) {
  using namespace description;
  for (KnownState* known : {&m_atStart, &m_atEnd}) {
    derivedOf(file, known->version, [&](auto& states) {
      for (std::size_t i = 0; i < 2; ++i) {
        revisions[i].elementsOf(file, states[i].elements);
        revisions[i].positionsOf(file, states[i].positions);
      }
    });
    optionalOf(file, known->meeting,
               [&](Meeting& meeting) { enumeratorOf(file, meeting, Meeting::Piercing); });
    file.real(known->clearance);
    optionalOf(file, known->witness, [&](ElementPair& pair) {
      fieldOf(file, pair.a);
      fieldOf(file, pair.b);
      if constexpr (File::kReads) {
        const auto& states = known->version.state();
        const bool isOfOthers = states[0].elements != revisions[0].now.elements ||
                                states[1].elements != revisions[1].now.elements;
        file.need(known->meeting == Meeting::Piercing &&
                      (isOfOthers ||
                       (pair.a < revisions[0].elementCount && pair.b < revisions[1].elementCount)),
                  "a pair of triangles does not exist");
      }
    });
  }
  derivedOf(file, m_topologies, [&](auto& states) {
    for (std::size_t i = 0; i < 2; ++i) revisions[i].elementsOf(file, states[i]);
  });
  fieldOf(file, m_isUnwelded);
  fieldOf(file, m_checkCredit);
  if constexpr (File::kReads)
    file.need(m_checkCredit >= 0 && m_checkCredit < 0x10000, "a number is out of range");
}

}  // namespace palpate
