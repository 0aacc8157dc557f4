"""Exact signs for many points at once: in float64, and in fractions where it is undecided."""

from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._results import FloatArray

Signs = npt.NDArray[np.int8]

# Shewchuk (1997), orient3d: a determinant in doubles is off by less than this times the sum of the
# absolute values of its terms. Below the smallest sum, underflow could add to the error.
_ERROR = 8e-16
_SMALLEST_SUM = 1e-280


def orientations(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Signs:
    """(n,) signs of the volumes of n tetrahedra, 0: flat. Positions are (n, 3).

    The sign is 1 if d sees the triangle a b c clockwise, as in a tetrahedron of VTK.
    """
    with np.errstate(all="ignore"):
        u, v, w = b - a, c - a, d - a
        terms = np.stack([u[:, i] * v[:, j] * w[:, k] for i, j, k in _EVEN], axis=1)
        odd = np.stack([u[:, i] * v[:, j] * w[:, k] for i, j, k in _ODD], axis=1)
        determinant = _sum(terms) - _sum(odd)
        size = _sum(abs(terms)) + _sum(abs(odd))
        certain = (abs(determinant) > _ERROR * size) & (size > _SMALLEST_SUM) & np.isfinite(size)
    signs: Signs = np.sign(np.where(certain, determinant, 0)).astype(np.int8)
    for row in np.flatnonzero(~certain):
        signs[row] = _sign(a[row], b[row], c[row], d[row])
    return signs


_EVEN = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
_ODD = ((0, 2, 1), (1, 0, 2), (2, 1, 0))


def _sum(terms: FloatArray) -> FloatArray:
    result: FloatArray = (terms[:, 0] + terms[:, 1]) + terms[:, 2]
    return result


def _sign(*corners: npt.NDArray[Any]) -> int:
    a, b, c, d = ([Fraction(x) for x in corner.tolist()] for corner in corners)
    u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d))
    volume = sum(u[i] * v[j] * w[k] for i, j, k in _EVEN) - sum(
        u[i] * v[j] * w[k] for i, j, k in _ODD
    )
    return (volume > 0) - (volume < 0)
