#include "Mesh/FaceBlock.h"

#include "Mesh/AngleSeries.h"

#include <numbers>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Mesh/FaceBlock.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace face_block {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, FaceBlock::kLanes>;
using V = hn::Vec<D>;

/// The angle as in FaceAtCorner.cpp.
HWY_INLINE V angleOf(V sine, V cosine, V length) {
  const D d;
  const V one = hn::Set(d, 1.0);
  V tangent = hn::Div(sine, length + hn::Abs(cosine));
  for (int i = 0; i < 2; ++i) tangent = hn::Div(tangent, one + hn::Sqrt(one + tangent * tangent));
  const V square = tangent * tangent;
  V series = hn::Zero(d);
  for (const double inverse : kAngleSeries) series = hn::Set(d, inverse) - square * series;
  const V angle = hn::Set(d, 8.0) * tangent * (one - square * series);
  return hn::IfThenElse(hn::Lt(cosine, hn::Zero(d)), hn::Set(d, std::numbers::pi) - angle, angle);
}

HWY_INLINE hn::Mask<D> isModerate(V square) {
  const D d;
  return hn::And(hn::Gt(square, hn::Set(d, kLeastPlainSquare)),
                 hn::Lt(square, hn::Set(d, kMostPlainSquare)));
}

HWY_ATTR void weightedNormalsKernel(const FaceBlock& block, FaceBlockNormals& normals) {
  const D d;
  for (std::size_t lane = 0; lane < FaceBlock::kLanes; lane += hn::Lanes(d)) {
    const auto& [ofU, ofV] = block.edges;
    const Vector3<V> u{hn::Load(d, ofU[0] + lane), hn::Load(d, ofU[1] + lane),
                       hn::Load(d, ofU[2] + lane)},
        v{hn::Load(d, ofV[0] + lane), hn::Load(d, ofV[1] + lane), hn::Load(d, ofV[2] + lane)},
        across = cross(u, v);
    const V squareU = dot(u, u), squareV = dot(v, v), square = dot(across, across),
            length = hn::Sqrt(square);
    const auto isPlain = hn::And(hn::And(isModerate(squareU), isModerate(squareV)),
                                 hn::Gt(square, hn::Set(d, kLeastPlainSine) * squareU * squareV));
    const V weight = hn::Div(angleOf(length, dot(u, v), hn::Sqrt(squareU * squareV)), length);
    hn::Store(weight * across.x, d, normals.weighted[0] + lane);
    hn::Store(weight * across.y, d, normals.weighted[1] + lane);
    hn::Store(weight * across.z, d, normals.weighted[2] + lane);
    normals.isPlain = static_cast<std::uint8_t>(normals.isPlain | bitsOf(d, isPlain) << lane);
  }
  leaveLanes();
}

}  // namespace face_block

using face_block::weightedNormalsKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(weightedNormalsKernel);

FaceBlockNormals weightedNormals(const FaceBlock& block) {
  FaceBlockNormals normals;
  normals.isPlain = 0;
  HWY_DYNAMIC_DISPATCH(weightedNormalsKernel)(block, normals);
  return normals;
}

}  // namespace palpate
#endif
