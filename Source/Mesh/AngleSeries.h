#pragma once

namespace palpate {

/// Coefficients of the angle's series (FaceAtCorner.cpp), the last one first.
inline constexpr double kAngleSeries[] = {1.0 / 15, 1.0 / 13, 1.0 / 11, 1.0 / 9,
                                          1.0 / 7,  1.0 / 5,  1.0 / 3};
/// FaceAtCorner::isPlain(): L², bounds of the edges' squared lengths; the least squared sine of the
/// angle.
inline constexpr double kLeastPlainSquare = 0x1p-400, kMostPlainSquare = 0x1p400,
                        kLeastPlainSine = 0x1p-10;

}  // namespace palpate
