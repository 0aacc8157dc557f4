"""Poses and analytical shapes. Arrays in them are copies that cannot be written."""

from __future__ import annotations  # help() then shows the names of types

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from palpate._enums import ErrorCode
from palpate._errors import Error

FloatArray: TypeAlias = npt.NDArray[np.float64]


def _array(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape and not (shape[0] < 0 and array.shape[1:] == shape[1:]):
        raise Error(
            f"{name} has the shape {array.shape}; it must be {shape}.",
            ErrorCode.WRONG_POSITION_COUNT,
        )
    array.flags.writeable = False
    return array


class _Values:
    """Compares all fields by value and describes them in repr()."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            np.array_equal(value, other.__dict__[name]) for name, value in self.__dict__.items()
        )

    def __hash__(self) -> int:
        return hash(
            tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in self.__dict__.values())
        )

    def __repr__(self) -> str:
        def text(value: Any) -> str:
            if not isinstance(value, np.ndarray):
                return repr(value)
            return str(value.tolist()) if value.size <= 9 else f"<{len(value)} points>"

        fields = ", ".join(f"{name}={text(value)}" for name, value in self.__dict__.items())
        return f"{type(self).__name__}({fields})"


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Pose(_Values):
    """A rigid placement: a point x of the body is at rotation @ x + translation in the world.

    rotation     (3, 3)
    translation  (3,), L
    """

    rotation: FloatArray
    translation: FloatArray

    def __init__(
        self,
        rotation: npt.ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        translation: npt.ArrayLike = (0, 0, 0),
    ) -> None:
        object.__setattr__(self, "rotation", _array(rotation, (3, 3), "rotation"))
        object.__setattr__(self, "translation", _array(translation, (3,), "translation"))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class RigidMotion(_Values):
    """The poses of a body at both ends of the step."""

    before: Pose
    now: Pose

    def __init__(self, before: Pose | None = None, now: Pose | None = None) -> None:
        object.__setattr__(self, "before", Pose() if before is None else before)
        object.__setattr__(self, "now", Pose() if now is None else now)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Sphere(_Values):
    """A ball. centre: (3,), L. radius: L, finite, not negative."""

    centre: FloatArray
    radius: float

    def __init__(self, centre: npt.ArrayLike = (0, 0, 0), radius: float = 0.0) -> None:
        object.__setattr__(self, "centre", _array(centre, (3,), "centre"))
        object.__setattr__(self, "radius", float(radius))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Capsule(_Values):
    """All points within the radius of the segment p0 p1. p0, p1: (3,), L. radius: L."""

    p0: FloatArray
    p1: FloatArray
    radius: float

    def __init__(
        self,
        p0: npt.ArrayLike = (0, 0, 0),
        p1: npt.ArrayLike = (0, 0, 0),
        radius: float = 0.0,
    ) -> None:
        object.__setattr__(self, "p0", _array(p0, (3,), "p0"))
        object.__setattr__(self, "p1", _array(p1, (3,), "p1"))
        object.__setattr__(self, "radius", float(radius))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Plane(_Values):
    """The half-space behind a plane, or with two_sided the plane alone.

    point   (3,), L
    normal  (3,), out of the half-space; any length but 0
    """

    point: FloatArray
    normal: FloatArray
    two_sided: bool

    def __init__(
        self,
        point: npt.ArrayLike = (0, 0, 0),
        normal: npt.ArrayLike = (0, 0, 1),
        two_sided: bool = False,
    ) -> None:
        object.__setattr__(self, "point", _array(point, (3,), "point"))
        object.__setattr__(self, "normal", _array(normal, (3,), "normal"))
        object.__setattr__(self, "two_sided", bool(two_sided))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Box(_Values):
    """A box along the axes of the body. centre, half_extents: (3,), L."""

    centre: FloatArray
    half_extents: FloatArray

    def __init__(
        self, centre: npt.ArrayLike = (0, 0, 0), half_extents: npt.ArrayLike = (0, 0, 0)
    ) -> None:
        object.__setattr__(self, "centre", _array(centre, (3,), "centre"))
        object.__setattr__(self, "half_extents", _array(half_extents, (3,), "half_extents"))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Cylinder(_Values):
    """A cylinder with flat ends, whose centres p0 and p1 differ. p0, p1: (3,), L. radius: L."""

    p0: FloatArray
    p1: FloatArray
    radius: float

    def __init__(
        self,
        p0: npt.ArrayLike = (0, 0, 0),
        p1: npt.ArrayLike = (0, 0, 1),
        radius: float = 0.0,
    ) -> None:
        object.__setattr__(self, "p0", _array(p0, (3,), "p0"))
        object.__setattr__(self, "p1", _array(p1, (3,), "p1"))
        object.__setattr__(self, "radius", float(radius))


@dataclass(frozen=True, init=False, eq=False, repr=False)
class ConvexHull(_Values):
    """The convex hull of points. points: (n, 3), L; at least one."""

    points: FloatArray

    def __init__(self, points: npt.ArrayLike = ()) -> None:
        array = np.zeros((0, 3)) if np.size(points) == 0 else points
        object.__setattr__(self, "points", _array(array, (-1, 3), "points"))


AnalyticalGeometry: TypeAlias = Sphere | Capsule | Plane | Box | Cylinder | ConvexHull
