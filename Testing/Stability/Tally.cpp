#include "Tally.h"

#include "RestReference.h"
#include "TouchReference.h"

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

/// A case with its reference, and the same case with noise.
struct Judged {
  Case posed, noisy;
  std::vector<std::vector<Touch>> touches;  ///< of each frame
  std::vector<Rest> rests;                  ///< at the end of each frame
  bool touchingAtStart = false, touching = false;

  bool startsIntersecting(std::size_t frame) const {
    return frame == 0 ? touchingAtStart : rests[frame - 1].intersect;
  }
};

Judged judge(const Sweep& sweep, double value, testing::Random& random) {
  Judged judged;
  judged.posed = sweep.make(value, random);
  constexpr double kNoise = 1e-7;
  judged.noisy = neighbourOf(judged.posed, kNoise, random);
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

/// The answers of a method, one a frame.
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

bool reports(const Claims& claims, const FeaturePair& features) {
  return std::any_of(claims.claims.begin(), claims.claims.end(),
                     [&](const Claim& claim) { return claim.features == features; });
}

/// True if the claims have this touch, or its substitute where the answer reports only distinct
/// impacts.
bool reports(const Claims& claims, const Touch& touch) {
  if (reports(claims, touch.features)) return true;
  const accuracy::Incidence one({{0, 1, 2}});
  const accuracy::Substitutes substitutes(claims);
  const auto stands = [&](const Claim& claim, double late) {
    return !touch.isBefore(claim.time - late) && !touch.isWrongSide(claim.normal, claim.time);
  };
  const Claim* substitute = substitutes.find(touch.features, one, one);
  if (substitute && stands(*substitute, 0.0)) return true;
  // One with a triangle's interior may be late by timeTolerance.
  return substitutes.findBeside(touch.features, one, one, [&](const Claim& claim) {
    return stands(claim, ContinuousSettings{}.timeTolerance);
  });
}

/// Compares the normal with the side that the features came from. A claim about triangles is wrong
/// only if all of their touches say so.
bool isWrongSide(const Claim& claim, const std::vector<Touch>& touches) {
  if (claim.features.kind != Kind::Triangles) {
    const Touch* touch = find(touches, claim.features);
    return touch != nullptr && touch->isWrongSide(claim.normal, claim.time);
  }
  return !touches.empty() && std::all_of(touches.begin(), touches.end(), [&](const Touch& touch) {
    return touch.isWrongSide(claim.normal, claim.time);
  });
}

/// True if the normal pushes a's corner into b. The corner started behind b and belongs in front of
/// it.
bool isInwards(const Claim& claim, const Case::Frame& now) {
  const auto& b = now.b;
  const Vector3d outwards = (b[1] - b[0]).cross(b[2] - b[0]).normalized();
  const bool ofCorner = claim.features.kind == Kind::VertexTriangle && claim.features.ids[0] == 0;
  return (ofCorner || claim.features.kind == Kind::Triangles) && claim.normal.dot(outwards) < -0.1;
}

bool hasWrongSide(const Claims& claims, const Judged& judged, std::size_t frame) {
  return std::any_of(claims.claims.begin(), claims.claims.end(), [&](const Claim& claim) {
    return judged.posed.startsInside ? isInwards(claim, judged.posed.frames[frame + 1])
                                     : isWrongSide(claim, judged.touches[frame]);
  });
}

bool isWrong(const Claims& claims, const Judged& judged, std::size_t frame) {
  const std::vector<Touch>& touches = judged.touches[frame];
  if (claims.ofTriangles) return claims.triangles.empty() && !touches.empty();
  return hasWrongSide(claims, judged, frame) ||
         std::any_of(touches.begin(), touches.end(),
                     [&](const Touch& touch) { return !reports(claims, touch); });
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

/// Compares each feature pair with the definition of the method.
void checkDefinition(Definition definition, const Claims& claims, const Judged& judged,
                     std::size_t frame, Tally& tally) {
  const std::vector<Touch>& touches = judged.touches[frame];
  const Rest& rest = judged.rests[frame];
  const double thickness = judged.posed.thickness;
  if (definition == Definition::Intersection) {
    tally.featuresMissing += rest.intersect && claims.triangles.empty();
    tally.featuresExtra += !rest.intersect && !claims.triangles.empty();
  } else if (definition == Definition::Proximity) {
    for (const Rest::Near& near : rest.pairs) {
      const bool isReported = reports(claims, near.features);
      tally.featuresMissing += near.distance < thickness - near.error && !isReported;
      tally.featuresExtra += near.distance > thickness + near.error && isReported;
    }
    tally.featuresExtra += static_cast<std::size_t>(
        std::count_if(claims.claims.begin(), claims.claims.end(),
                      [&](const Claim& claim) { return !isNear(rest, claim); }));
  } else if (definition == Definition::DistinctAuto && judged.startsIntersecting(frame)) {
    tally.featuresMissing += !touches.empty() && claims.claims.empty();
  } else if (definition == Definition::Auto || definition == Definition::DistinctAuto) {
    for (const Touch& touch : touches) tally.featuresMissing += !reports(claims, touch);
  } else if (definition == Definition::Continuous) {
    for (const Touch& touch : touches) tally.featuresMissing += !reports(claims, touch.features);
    for (const Claim& claim : claims.claims) {
      const Touch* touch = find(touches, claim.features);
      tally.featuresExtra += touch == nullptr;
      tally.untimely += touch != nullptr && !touch->isTimely(claim.time);
    }
  }
}

bool turns(const Claims& claims, const Claims& withNoise) {
  std::map<FeaturePair, Vector3d> normals;
  for (const Claim& claim : claims.claims) normals.emplace(claim.features, claim.normal);
  return std::any_of(withNoise.claims.begin(), withNoise.claims.end(), [&](const Claim& claim) {
    const auto own = normals.find(claim.features);
    return own != normals.end() && own->second.dot(claim.normal) < 0;
  });
}

void add(const Judged& judged, const Subject& subject, Tally& tally) {
  double untimed = 0;
  const auto answers = answersOf(subject.contestant, judged.posed, tally.milliseconds);
  const auto withNoise = answersOf(subject.contestant, judged.noisy, untimed);
  bool reported = false, reportsTouch = false, wrongSide = false, turnedByNoise = false;
  for (std::size_t f = 0; f < answers.size(); ++f) {
    const Claims& claims = answers[f];
    const bool any = !claims.claims.empty() || !claims.triangles.empty();
    reported |= any;
    // Proximity and Auto also report features that are near. The others report a touch.
    reportsTouch |= any && (claims.ofTriangles || subject.definition == Definition::Continuous);
    wrongSide |= hasWrongSide(claims, judged, f);
    turnedByNoise |= turns(claims, withNoise[f]);
    checkContacts(claims, tally);
    checkContacts(withNoise[f], tally);
    if (claims.trusted) {
      const bool wrong = isWrong(claims, judged, f);
      ++tally.answers;
      tally.wrong += wrong;
      tally.wrongTrusted += wrong && *claims.trusted;
      tally.rightUntrusted += !wrong && !*claims.trusted;
    }
    checkDefinition(subject.definition, claims, judged, f, tally);
  }
  const bool falseNegative = judged.touching && !reported;
  ++tally.cases;
  tally.touching += judged.touching;
  tally.falseNegatives += falseNegative;
  tally.falseNegativesNew += falseNegative && !judged.touchingAtStart;
  tally.falsePositives += !judged.touching && reportsTouch;
  tally.wrongSide += wrongSide;
  tally.turnedByNoise += turnedByNoise;
}

}  // namespace

std::vector<Subject> subjects() {
  const std::map<std::pair<std::string, std::string>, Definition> swept{
      {{"Intersection", "once a frame"}, Definition::Intersection},
      {{"Proximity", "1/20 edge"}, Definition::Proximity},
      {{"Proximity in substeps", "1/20 edge; 8 substeps"}, Definition::None},
      {{"Continuous", "exact"}, Definition::Continuous},
      {{"Auto", "1/20 edge"}, Definition::Auto},
      {{"Auto: distinct", "1/20 edge"}, Definition::DistinctAuto},
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
