"""The enumerations. A call that takes one also takes its name as a string, in any case."""

import enum
from typing import Any, Literal, TypeVar

_E = TypeVar("_E", bound=enum.IntEnum)


class _Named(enum.IntEnum):
    """Numbers in arrays of records compare with members; messages show their names."""

    def __str__(self) -> str:
        return f"{type(self).__name__}.{self.name}"


class GeometryType(_Named):
    """What the elements of a geometry are."""

    TRIANGLES = 0
    LINES = 1
    POINTS = 2
    SHAPE = 3
    FIELD = 4


class OctreeUpdate(_Named):
    """How an octree follows its geometry. Contacts do not depend on it."""

    AUTO = 0
    REBUILD = 1


class OctreeBounds(_Named):
    """What bounds the elements of a placed body. Contacts do not depend on it."""

    BOX = 0
    DOP14 = 1
    DOP18 = 2


class Engine(_Named):
    """How candidates are found. Both engines give the same contacts."""

    OCTREE = 0
    BRUTE_FORCE = 1


class Method(_Named):
    """The definition of a contact. Docs/SupportMatrix.md says which geometries it answers."""

    AUTO = 0
    INTERSECTION = 1
    PROXIMITY = 2
    CONTINUOUS = 3
    DISTANCE_FIELD = 4
    PROXY = 5


class Contacts(_Named):
    """Which of several contacts at the same features are reported."""

    DISTINCT = 0
    ALL = 1


class Sidedness(_Named):
    """From which sides other geometries can touch a triangle mesh."""

    BOTH = 0
    OUTER = 1


class ContactKind(_Named):
    """In which list of CollisionData a contact is."""

    VERTEX_TRIANGLE = 0
    TRIANGLE_VERTEX = 1
    EDGE_EDGE = 2
    SHAPE = 3
    SHAPE_SHAPE = 4


class ContactEnd(_Named):
    """Why a contact ended."""

    NONE = 0
    CUT = 1
    DISABLED = 2
    FILTERED = 3
    APART = 4


class ThreadEventCause(_Named):
    """Why a count of ThreadTopology changed."""

    PASSED = 0
    END_PASSED = 1
    SET = 2
    CUT = 3
    DISABLED = 4


class ContactFeaturesKind(_Named):
    """The features that a contact predicate receives."""

    VERTEX_TRIANGLE = 0
    TRIANGLE_VERTEX = 1
    EDGE_EDGE = 2


class ShapeElement(_Named):
    """The type of feature that touches a shape or a distance field."""

    VERTEX = 0
    EDGE = 1
    FACE = 2


class TriangleFeature(_Named):
    """The part of a triangle that holds a point."""

    CORNER_A = 0
    CORNER_B = 1
    CORNER_C = 2
    EDGE_AB = 3
    EDGE_BC = 4
    EDGE_CA = 5
    FACE = 6


class EdgeFeature(_Named):
    """The part of an edge that holds a point."""

    START = 0
    END = 1
    INTERIOR = 2


class ErrorCode(_Named):
    """The reason for an Error. Docs/Errors.md has cause and remedy of each code."""

    NON_FINITE_POSITION = 0
    WRONG_POSITION_COUNT = 1
    INDEX_OUT_OF_RANGE = 2
    UNKNOWN_GEOMETRY = 3
    UNKNOWN_PAIR = 4
    DUPLICATE_PAIR = 5
    INVALID_SETTINGS = 6
    NOT_CLOSED = 7
    UNSUPPORTED_METHOD = 8
    TOO_LARGE = 9
    NOT_AVAILABLE = 10
    FILE = 11
    INVALID_RADIUS = 12
    INVALID_SHAPE = 13
    INVALID_TRANSFORM = 14
    SHARED_FACE = 15
    INVALID_CALL = 16
    IMPACT_REMAINS = 17
    MEMORY_LIMIT = 18
    CANCELLED = 19


class AuditFailureFault(_Named):
    """How a frame and brute force differ."""

    FALSE_NEGATIVE = 0
    FALSE_POSITIVE = 1
    DIFFERENT = 2


class AuditFailureList(_Named):
    """The list of CollisionData in which a contact is or should be."""

    VERTEX_TRIANGLE = 0
    TRIANGLE_VERTEX = 1
    EDGE_EDGE = 2
    INTERSECTING_TRIANGLES = 3
    EARLIEST = 4
    SHAPE = 5
    SHAPE_SHAPE = 6


class MethodReason(_Named):
    """Why a pair was answered by Validity.method."""

    REQUESTED = 0
    STILL = 1
    SLOW = 2
    FAST = 3
    MIXED = 4
    CHEAPEST = 5
    NO_ALTERNATIVE = 6
    ALLOWED_ERROR = 7
    OUT_OF_TIME = 8


class InsideRule(_Named):
    """Which points are inside a body."""

    CLOSED = 0
    WINDING_NUMBER = 1


class DirectionChange(_Named):
    """How PenetrationTracker chose the direction of a vertex."""

    ENTERED = 0
    NONE = 1
    KEPT = 2
    JUMPED = 3


class LooseOctreeUpdate(_Named):
    """What the last update did to an octree."""

    REBUILT = 0
    REFITTED = 1
    UNCHANGED = 2


OctreeUpdateName = Literal["auto", "rebuild"]
OctreeBoundsName = Literal["box", "dop14", "dop18"]
EngineName = Literal["octree", "brute_force"]
MethodName = Literal[
    "auto", "intersection", "proximity", "continuous", "distance_field", "proxy"
]
ContactsName = Literal["distinct", "all"]
SidednessName = Literal["both", "outer"]
InsideRuleName = Literal["closed", "winding_number"]


def parse(kind: type[_E], value: Any) -> _E:
    """The enumerator of a member, of its name in any case, or of its number."""
    from palpate._errors import Error

    if isinstance(value, str):
        name = value.replace("_", "").replace("-", "").lower()
        for member in kind:
            if member.name.replace("_", "").lower() == name:
                return member
    elif not isinstance(value, (bool, enum.Enum)) or isinstance(value, kind):
        try:
            return kind(value)
        except ValueError:
            pass
    names = ", ".join(repr(member.name.lower()) for member in kind)
    raise Error(f"{value!r} is no {kind.__name__}; use {names}.", ErrorCode.INVALID_SETTINGS)
