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


def pierce(a: FloatArray, b: FloatArray) -> npt.NDArray[np.bool_]:
    """(n,) whether triangles a (n, 3, 3) and b pierce each other, and do not only touch.

    Each has corners on both sides of the other's plane, and an edge that passes from one side to the
    other meets the other triangle. A body that rests on a face has no triangle with such corners.
    """
    sides_a = [orientations(b[:, 0], b[:, 1], b[:, 2], a[:, i]) for i in range(3)]
    sides_b = [orientations(a[:, 0], a[:, 1], a[:, 2], b[:, i]) for i in range(3)]
    both_sided = _on_both_sides(sides_a) & _on_both_sides(sides_b)
    result = np.zeros(len(a), dtype=bool)
    edges = ((0, 1), (1, 2), (2, 0))
    volumes = {
        (e, f): orientations(a[:, e[0]], a[:, e[1]], b[:, f[0]], b[:, f[1]])
        for e in edges
        for f in edges
    }
    for e in edges:
        through = np.stack([volumes[e, f] for f in edges])
        result |= (sides_a[e[0]] * sides_a[e[1]] < 0) & _one_sided(through)
        through = np.stack([volumes[f, e] for f in edges])
        result |= (sides_b[e[0]] * sides_b[e[1]] < 0) & _one_sided(through)
    result &= both_sided
    return result


def _on_both_sides(sides: list[Signs]) -> npt.NDArray[np.bool_]:
    result: npt.NDArray[np.bool_] = (np.min(sides, axis=0) < 0) & (np.max(sides, axis=0) > 0)
    return result


def _one_sided(signs: Signs) -> npt.NDArray[np.bool_]:
    result: npt.NDArray[np.bool_] = (signs >= 0).all(axis=0) | (signs <= 0).all(axis=0)
    return result
