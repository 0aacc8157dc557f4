#include "Search/Question.h"

namespace palpate {

MeshPair Question::meshes(const FloatPair* floats) const {
  PairSettings wanted = settings();
  wanted.method = plan.method;
  if (wanted.continuous.earliestTimeOnly) wanted.contacts = Contacts::All;
  return {a.mesh,
          b.mesh,
          wanted,
          floats,
          plan.step,
          wanted.restDistance > 0.0 ? &filters.nearAtRest : nullptr,
          filters.predicate ? &filters.predicate : nullptr,
          keepsApart};
}

FieldContacts Answer::fieldContacts(const Question& question, const PlacedField& placed) {
  PALPATE_ASSERT(question.usesField());
  if (!fieldScratch) fieldScratch = std::make_unique<FieldScratch>();
  const MeshPair both = question.meshes();
  return {question.mesh().mesh, placed, both.settings.contacts, both.thicknessAtEnd(),
          *fieldScratch};
}

}  // namespace palpate
