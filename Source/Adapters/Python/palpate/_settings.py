"""Settings, as keyword arguments. They are immutable; dataclasses.replace() changes a copy.

L is the length unit of the positions. The C++ header <palpate/Settings.h> has all details.
"""

import enum
import os
from dataclasses import dataclass, field

from palpate._enums import (
    Contacts,
    ContactsName,
    Engine,
    EngineName,
    InsideRule,
    InsideRuleName,
    Method,
    MethodName,
    OctreeBounds,
    OctreeBoundsName,
    OctreeUpdate,
    OctreeUpdateName,
    Sidedness,
    SidednessName,
    parse,
)
from palpate._palpate import Executor


class _Settings:
    """Names of enumerators become the enumerators."""

    def __post_init__(self) -> None:
        for name, default in type(self).__dict__.items():
            if isinstance(default, enum.IntEnum):
                object.__setattr__(self, name, parse(type(default), getattr(self, name)))


@dataclass(frozen=True, kw_only=True)
class OctreeSettings(_Settings):
    """Settings of octrees. Contacts do not depend on them.

    max_depth              deepest level, in [1, 60]; the root has level 0
    max_elements_per_leaf  a cell that holds more is split, in [1, 1024]
    update                 an OctreeUpdate or its name
    bounds                 an OctreeBounds or its name, for bodies that set_transform() places
    keeps_pairs            slow meshes keep candidates for later detections, where that pays
    """

    max_depth: int = 32
    max_elements_per_leaf: int = 32
    update: OctreeUpdate | OctreeUpdateName = OctreeUpdate.AUTO
    bounds: OctreeBounds | OctreeBoundsName = OctreeBounds.BOX
    keeps_pairs: bool = True


@dataclass(frozen=True, kw_only=True)
class AuditSettings:
    """A check of a sample of each frame by brute force.

    features   number of features tested per pair and frame; 0: no audit
    seed       the sample depends on it, the frame number and the pair only
    folder     an existing folder for captures of failures; empty: none
    max_files  most files over the life of an OctreeBasedCD
    """

    features: int = 0
    seed: int = 0
    folder: str | os.PathLike[str] = ""
    max_files: int = 100

    def __post_init__(self) -> None:
        object.__setattr__(self, "folder", os.fspath(self.folder))


@dataclass(frozen=True, kw_only=True)
class Settings(_Settings):
    """Settings of an OctreeBasedCD, for its whole life.

    octree           OctreeSettings
    engine           an Engine or its name; both give the same contacts
    threads          threads of a frame, in [0, 1024]; 0: one per core
    audit            AuditSettings
    trace_frames     number of last detections that write_trace() writes; 0: none, and no cost
    executor         runs the work of a frame; None: a thread pool of its own. A pickle has none.
    memory_limit     bytes that the object may allocate; 0: no limit
    """

    octree: OctreeSettings = field(default_factory=OctreeSettings)
    engine: Engine | EngineName = Engine.OCTREE
    threads: int = 0
    audit: AuditSettings = field(default_factory=AuditSettings)
    trace_frames: int = 0
    executor: Executor | None = None
    memory_limit: int = 0

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "executor": None}


@dataclass(frozen=True, kw_only=True)
class PairSettings(_Settings):
    """How one pair is tested.

    method              a Method or its name, as "continuous"
    thickness           L, the contact distance: features at most this far apart are contacts
    contacts            a Contacts or its name
    motion_tolerance    L, Auto only: motion up to which a feature is tested at the step's end;
                        negative: half the thickness
    rest_distance       L, self-collision only: features nearer than this along the mesh at rest
                        are no contacts
    time_tolerance      fraction of the step by which a time of impact may be early
    earliest_time_only  Continuous only: report earliest_time_of_impact and no contacts
    allowed_error       L: what an answer by a proxy or a field may be off by
    free_motion_reach   L: positive: detect_collision() also finds free_motion(), up to half of this
    track_contacts      contacts have an identity: CollisionData.tracked_vertex_triangle and so on
    report_crossings    Auto and Continuous: CollisionData.crossings
    smooth_normals      CollisionData.smooth_vertex_triangle and so on, which rows use
    remember_sides      Auto and Continuous: contacts of what passed lead back until it has
                        returned
    widest_normal_cone  rad, in (0, 1.5], Proxy only
    priority            detect_collision() with a budget begins with pairs of the highest priority
    """

    method: Method | MethodName = Method.AUTO
    thickness: float = 0.0
    contacts: Contacts | ContactsName = Contacts.DISTINCT
    rest_distance: float = 0.0
    allowed_error: float = 0.0
    free_motion_reach: float = 0.0
    track_contacts: bool = False
    report_crossings: bool = False
    smooth_normals: bool = False
    remember_sides: bool = False
    time_tolerance: float = 1e-6
    earliest_time_only: bool = False
    motion_tolerance: float = -1.0
    widest_normal_cone: float = 0.25
    priority: int = 0


@dataclass(frozen=True, kw_only=True)
class SurfaceProxySettings:
    """The leaves that attach_surface_proxy() builds.

    reach               L, positive: the distance from the surface up to which they answer
    error_bound         L, positive: the largest proven error
    widest_normal_cone  rad, in (0, 1.5]
    """

    reach: float = 0.0
    error_bound: float = 0.0
    widest_normal_cone: float = 0.25


@dataclass(frozen=True, kw_only=True)
class CollisionFilter(_Settings):
    """Which pairs a geometry takes part in, and from which sides.

    groups     bits: the groups that the geometry belongs to
    mask       bits: the groups that it collides with
    sidedness  a Sidedness or its name
    """

    groups: int = 1
    mask: int = 0xFFFFFFFF
    sidedness: Sidedness | SidednessName = Sidedness.BOTH


@dataclass(frozen=True, kw_only=True)
class InsideSettings(_Settings):
    """Which points are inside a body.

    rule    an InsideRule or its name
    margin  in [0, 1/2), WINDING_NUMBER only: numbers this near to 1/2 count as undecided
    """

    rule: InsideRule | InsideRuleName = InsideRule.CLOSED
    margin: float = 0.0
