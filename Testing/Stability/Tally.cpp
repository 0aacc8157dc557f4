#include "Tally.h"

#include "RestTruth.h"
#include "TouchTruth.h"

#include <palpate/Error.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>

namespace palpate::stability {

namespace {

using accuracy::Claim;
using accuracy::Claims;
using Eigen::Vector3d;
using Kind = FeaturePair::Kind;

/// A case, all that is true of it, and the same case in noise.
struct Judged {
  Case posed, neighbour;
  std::vector<std::vector<Touch>> touches;  ///< frame by frame
  std::vector<Rest> rests;                  ///< at the end of each frame
  bool touchingAtStart = false, touching = false;
};

Judged judge(const Sweep& sweep, double value, testing::Random& random) {
  Judged judged;
  judged.posed = sweep.make(value, random);
  constexpr double kNoise = 1e-7;
  judged.neighbour = neighbourOf(judged.posed, kNoise, random);
  const auto& frames = judged.posed.frames;
  judged.touching = judged.touchingAtStart =
      restOf(frames.front(), judged.posed.thickness).intersect;
  for (std::size_t f = 1; f < frames.size(); ++f) {
    judged.touches.push_back(touchesWithin(frames[f - 1], frames[f]));
    judged.rests.push_back(restOf(frames[f], judged.posed.thickness));
    judged.touching |= !judged.touches.back().empty() || judged.rests.back().intersect;
  }
  return judged;
}

/// What a method says of each frame.
std::vector<Claims> answersOf(const accuracy::Contestant& contestant, const Case& posed,
                              double& milliseconds) {
  const auto run = contestant.run(sceneOf(posed), positionsOf(posed.frames.front()));
  std::vector<Claims> answers;
  for (std::size_t f = 1; f < posed.frames.size(); ++f) {
    milliseconds += run->step(positionsOf(posed.frames[f]));
    answers.push_back(run->claims(0));
  }
  return answers;
}

const Touch* find(const std::vector<Touch>& touches, const FeaturePair& features) {
  const auto found = std::find_if(touches.begin(), touches.end(),
                                  [&](const Touch& touch) { return touch.features == features; });
  return found == touches.end() ? nullptr : &*found;
}

bool says(const Claims& claims, const FeaturePair& features) {
  return std::any_of(claims.claims.begin(), claims.claims.end(),
                     [&](const Claim& claim) { return claim.features == features; });
}

/// Of this touch, or where impacts of the same closest features are said once, for this touch.
bool says(const Claims& claims, const Touch& touch) {
  if (says(claims, touch.features)) return true;
  const accuracy::Incidence one({{0, 1, 2}});
  const Claim* substitute = accuracy::Substitutes(claims).find(touch.features, one, one);
  return substitute && !touch.isBefore(substitute->time) &&
         !touch.isTurned(substitute->normal, substitute->time);
}

/// Where the features came from their touch in this frame decides; of triangles the kindest.
bool isTurned(const Claim& claim, const std::vector<Touch>& touches) {
  if (claim.features.kind != Kind::Triangles) {
    const Touch* touch = find(touches, claim.features);
    return touch != nullptr && touch->isTurned(claim.normal, claim.time);
  }
  return !touches.empty() && std::all_of(touches.begin(), touches.end(), [&](const Touch& touch) {
    return touch.isTurned(claim.normal, claim.time);
  });
}

/// A corner that started inside belongs where the triangle's normal points; a's corners are those
/// that came through.
bool isInwards(const Claim& claim, const Case::Frame& now) {
  const auto& b = now.b;
  const Vector3d outwards = (b[1] - b[0]).cross(b[2] - b[0]).normalized();
  const bool ofCorner = claim.features.kind == Kind::VertexTriangle && claim.features.ids[0] == 0;
  return (ofCorner || claim.features.kind == Kind::Triangles) && claim.normal.dot(outwards) < -0.1;
}

bool isAnyTurned(const Claims& claims, const Judged& judged, std::size_t frame) {
  return std::any_of(claims.claims.begin(), claims.claims.end(), [&](const Claim& claim) {
    return judged.posed.startsInside ? isInwards(claim, judged.posed.frames[frame + 1])
                                     : isTurned(claim, judged.touches[frame]);
  });
}

bool isWrong(const Claims& claims, const Judged& judged, std::size_t frame) {
  const std::vector<Touch>& touches = judged.touches[frame];
  if (claims.ofTriangles) return claims.triangles.empty() && !touches.empty();
  return isAnyTurned(claims, judged, frame) ||
         std::any_of(touches.begin(), touches.end(),
                     [&](const Touch& touch) { return !says(claims, touch); });
}

void checkContacts(const Claims& claims, Tally& tally) {
  for (const Claim& claim : claims.claims) {
    ++tally.contacts;
    const bool finite =
        claim.normal.allFinite() && std::isfinite(claim.distance) && std::isfinite(claim.time);
    tally.notFinite += !finite;
    tally.notUnit += finite && std::abs(claim.normal.norm() - 1) > 1e-9;
  }
}

bool isNear(const Rest& rest, const Claim& claim) {
  return std::any_of(rest.pairs.begin(), rest.pairs.end(),
                     [&](const Rest::Near& near) { return near.features == claim.features; });
}

/// Features one by one, against what the method is defined to report.
void checkDefinition(Definition definition, const Claims& claims, const std::vector<Touch>& touches,
                     const Rest& rest, double thickness, Tally& tally) {
  if (definition == Definition::Intersection) {
    tally.undefinedMissed += rest.intersect && claims.triangles.empty();
    tally.undefinedInvented += !rest.intersect && !claims.triangles.empty();
  } else if (definition == Definition::Proximity) {
    for (const Rest::Near& near : rest.pairs) {
      const bool said = says(claims, near.features);
      tally.undefinedMissed += near.distance < thickness - near.error && !said;
      tally.undefinedInvented += near.distance > thickness + near.error && said;
    }
    tally.undefinedInvented += static_cast<std::size_t>(
        std::count_if(claims.claims.begin(), claims.claims.end(),
                      [&](const Claim& claim) { return !isNear(rest, claim); }));
  } else if (definition == Definition::Auto) {
    for (const Touch& touch : touches) tally.undefinedMissed += !says(claims, touch);
  } else if (definition == Definition::Continuous) {
    for (const Touch& touch : touches) tally.undefinedMissed += !says(claims, touch.features);
    for (const Claim& claim : claims.claims) {
      const Touch* touch = find(touches, claim.features);
      tally.undefinedInvented += touch == nullptr;
      tally.untimely += touch != nullptr && !touch->isTimely(claim.time);
    }
  }
}

bool flips(const Claims& claims, const Claims& inNoise) {
  std::map<FeaturePair, Vector3d> normals;
  for (const Claim& claim : claims.claims) normals.emplace(claim.features, claim.normal);
  return std::any_of(inNoise.claims.begin(), inNoise.claims.end(), [&](const Claim& claim) {
    const auto own = normals.find(claim.features);
    return own != normals.end() && own->second.dot(claim.normal) < 0;
  });
}

void add(const Judged& judged, const Subject& subject, Tally& tally) {
  double untimed = 0;
  const auto answers = answersOf(subject.contestant, judged.posed, tally.milliseconds);
  const auto inNoise = answersOf(subject.contestant, judged.neighbour, untimed);
  bool reported = false, touchReported = false, turned = false, flipped = false;
  for (std::size_t f = 0; f < answers.size(); ++f) {
    const Claims& claims = answers[f];
    const bool any = !claims.claims.empty() || !claims.triangles.empty();
    reported |= any;
    // Proximity and Auto say near, the others say touch.
    touchReported |= any && (claims.ofTriangles || subject.definition == Definition::Continuous);
    turned |= isAnyTurned(claims, judged, f);
    flipped |= flips(claims, inNoise[f]);
    checkContacts(claims, tally);
    checkContacts(inNoise[f], tally);
    if (claims.trusted) {
      const bool wrong = isWrong(claims, judged, f);
      ++tally.answers;
      tally.wrong += wrong;
      tally.silent += wrong && *claims.trusted;
      tally.alarms += !wrong && !*claims.trusted;
    }
    checkDefinition(subject.definition, claims, judged.touches[f], judged.rests[f],
                    judged.posed.thickness, tally);
  }
  const bool missed = judged.touching && !reported, invented = !judged.touching && touchReported;
  ++tally.cases;
  tally.touching += judged.touching;
  tally.missed += missed;
  tally.missedApart += missed && !judged.touchingAtStart;
  tally.invented += invented;
  tally.turned += turned;
  tally.flipped += flipped;
}

}  // namespace

std::vector<Subject> subjects() {
  const std::map<std::pair<std::string, std::string>, Definition> swept{
      {{"Intersection", "once a frame"}, Definition::Intersection},
      {{"Proximity", "1/20 edge"}, Definition::Proximity},
      {{"Proximity in substeps", "1/20 edge; 8 substeps"}, Definition::None},
      {{"Continuous", "exact"}, Definition::Continuous},
      {{"Auto", "1/20 edge"}, Definition::Auto},
      {{"Auto: distinct", "1/20 edge"}, Definition::Auto},
      {{"FCL", "collide()"}, Definition::None}};
  std::vector<Subject> all;
  for (const accuracy::Contestant& contestant : accuracy::contestants()) {
    const auto found = swept.find({contestant.family, contestant.setting});
    if (found != swept.end()) all.push_back({contestant, found->second});
  }
  return all;
}

std::vector<Tally> runStep(const Sweep& sweep, double value, std::size_t count,
                           const std::vector<Subject>& all) {
  std::vector<Tally> tallies(all.size());
  testing::Random random(std::bit_cast<std::uint64_t>(value));
  for (std::size_t i = 0; i < count; ++i) {
    const Judged judged = judge(sweep, value, random);
    for (std::size_t s = 0; s < all.size(); ++s) add(judged, all[s], tallies[s]);
  }
  return tallies;
}

}  // namespace palpate::stability
