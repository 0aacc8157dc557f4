"""Results that are no arrays. L is the length unit of the positions."""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from palpate._enums import (
    AuditFailureFault,
    AuditFailureList,
    ContactFeaturesKind,
    Method,
    MethodReason,
)
from palpate._settings import PairSettings
from palpate._shapes import RigidMotion

FloatArray: TypeAlias = npt.NDArray[np.float64]
IndexArray: TypeAlias = npt.NDArray[np.uint32]


class ContactFeatures(NamedTuple):
    """What a contact predicate receives.

    kind  ContactFeaturesKind
    a, b  the index of a vertex or triangle, twice; or the two vertices of an edge, lower first
    tag_a, tag_b  of OctreeBasedCD.set_tags()
    """

    kind: ContactFeaturesKind
    a: tuple[int, int]
    b: tuple[int, int]
    tag_a: int = 0
    tag_b: int = 0


class CollisionPair(NamedTuple):
    """A pair of geometries that is tested in each frame, with its settings."""

    a: int
    b: int
    settings: PairSettings


class Welded(NamedTuple):
    """The result of weld().

    positions  (n, 3), L
    triangles  (m, 3), as many as were given
    vertex_of  for each vertex that was given, its new index
    """

    positions: FloatArray
    triangles: IndexArray
    vertex_of: IndexArray


class MeshArrays(NamedTuple):
    """A mesh as in a file; see read_mesh_file(). palpate.add() takes it.

    positions        (n, 3), L: the file's length unit
    triangles        (m, 3) vertex indices
    tetrahedra       (m, 4)
    segments         (m, 2); a polyline of n vertices gives n - 1
    points           (m,) the vertex of each element that is a point
    joined_vertices  vertices that read_mesh_file() joined to others
    """

    positions: FloatArray
    triangles: IndexArray = np.empty((0, 3), np.uint32)
    tetrahedra: IndexArray = np.empty((0, 4), np.uint32)
    segments: IndexArray = np.empty((0, 2), np.uint32)
    points: IndexArray = np.empty(0, np.uint32)
    joined_vertices: int = 0

    def __repr__(self) -> str:
        counts = {name: len(getattr(self, name)) for name in self._fields[:5]}
        listed = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        return f"<palpate.MeshArrays: {listed}>"


class SimplifiedMesh(NamedTuple):
    """The result of simplify().

    positions  (n, 3), L
    triangles  (m, 3)
    distance   L: no point of the triangles is further than this from the mesh
    rounds     how often the mesh was simplified
    """

    positions: FloatArray
    triangles: IndexArray
    distance: float
    rounds: int


class MeshDefects(NamedTuple):
    """The edges because of which a mesh has no inside; see find_mesh_defects().

    open         (n, 2) edges of only one triangle
    flipped      (n, 2) edges that both triangles traverse in the same direction
    shared       (n, 2) edges of three triangles or more
    unwelded     whether no two triangles share a vertex, as in an STL file
    inside_out   whether the mesh is closed and wound inward; needs positions
    overlapping  (n, 2) triangles of different parts that touch; needs positions
    """

    open: IndexArray
    flipped: IndexArray
    shared: IndexArray
    unwelded: bool
    inside_out: bool
    overlapping: IndexArray

    @property
    def closed(self) -> bool:
        """Whether no edge is at fault."""
        return not (len(self.open) or len(self.flipped) or len(self.shared))


class TetrahedralSurface(NamedTuple):
    """The triangles with which a tetrahedral mesh collides.

    triangles   (n, 3) vertex indices, wound outward at rest
    tetrahedra  (n,) the tetrahedron to which each belongs
    """

    triangles: IndexArray
    tetrahedra: IndexArray


class Stencils(NamedTuple):
    """Contacts as four vertices with signed weights.

    ids        (n, 4) vertex indices
    weights    (n, 4); the weighted sum of the positions is (distance + radii) * normal
    normals    (n, 3), unit
    distances  (n,), L
    """

    ids: IndexArray
    weights: FloatArray
    normals: FloatArray
    distances: FloatArray


class Rows(NamedTuple):
    """Constraints of a solver: the gap of row i is (jacobian @ x)[i] - offsets[i].

    jacobian  (n, 3 m) scipy.sparse.csr_matrix, for the stacked positions x = X.ravel()
    offsets   (n,), L
    """

    jacobian: Any
    offsets: FloatArray


class Path(NamedTuple):
    """The result of SpatialQueries.path().

    inside   array with body, enter, leave (arc lengths, L), entry_element, exit_element
    outside  array with body, distance, at (L) and nearest, for each body without an interval
    """

    inside: npt.NDArray[Any]
    outside: npt.NDArray[Any]


class SolverVertices(NamedTuple):
    """The place of one geometry's vertices among those of a solver.

    now     (n, 3), L, in the world
    before  the same at the step's start; None: at rest
    first   the solver's number of vertex 0
    """

    now: npt.ArrayLike = ()
    before: npt.ArrayLike | None = None
    first: int = 0


class ContactSide(NamedTuple):
    """One geometry of a pair, for CollisionData.motions().

    vertices  SolverVertices or positions of a mesh, lines or points; None for a shape
    radii     none, one for all vertices, or one per vertex, L
    motion    of a shape
    """

    vertices: SolverVertices | npt.ArrayLike | None = None
    radii: npt.ArrayLike = ()
    motion: RigidMotion | None = None


class OctreeNode(NamedTuple):
    """A node of an octree. Boxes are (2, 3): the lower and the upper corner, L.

    parent: its place in the list of nodes; None for the root.
    """

    geometry: int
    depth: int
    bounds: FloatArray
    loose_bounds: FloatArray
    fitted_box: FloatArray
    parent: int | None
    elements: IndexArray


class AuditFailure(NamedTuple):
    """A contact in which a frame and brute force differ: a fault of the library."""

    a: int
    b: int
    frame: int
    fault: AuditFailureFault
    list: AuditFailureList
    expected: Any
    found: Any
    file: str
    file_error: str


@dataclass(frozen=True, kw_only=True)
class MemoryUse:
    """Bytes that an OctreeBasedCD holds, by what they are for."""

    geometries: int
    octrees: int
    pairs: int
    narrow_phase: int
    results: int
    queries: int
    snapshots: int
    total: int


@dataclass(frozen=True, kw_only=True)
class FrameStages:
    """Wall-clock milliseconds of a frame."""

    boxes: float
    octree: float
    pairs: float
    narrow_phase: float
    order: float

    @property
    def update(self) -> float:
        """From positions to octrees, ms."""
        return self.boxes + self.octree

    @property
    def total(self) -> float:
        """Of the whole frame, ms."""
        return self.update + self.pairs + self.narrow_phase + self.order


@dataclass(frozen=True, kw_only=True)
class UnfinishedPair:
    """A pair for which detect_collision() with a budget had no time.

    distance_bound  L: features of the two are proven not to be nearer
    age             that of the answer which the pair keeps, in detections
    exceeds_budget  the detection began with the pair, and the whole time was not enough for it
    """

    a: int
    b: int
    distance_bound: float
    age: int
    exceeds_budget: bool


@dataclass(frozen=True, kw_only=True)
class FrameStatistics:
    """Times and counts of one frame, over all geometries and pairs."""

    milliseconds: FrameStages
    geometries: int
    triangles: int
    segments: int
    points: int
    untested_vertices: int
    rebuilt_octrees: int
    refitted_octrees: int
    unchanged_octrees: int
    candidate_pairs: int
    feature_pairs: int
    contacts: int
    intersecting_triangles: int
    exact_decisions: int
    validity_pairs: int
    memory: MemoryUse
    peak_memory: MemoryUse
    unfinished_pairs: list[UnfinishedPair]
    free_motion_unfinished: bool


@dataclass(frozen=True, kw_only=True)
class PairStatistics:
    """Time (ms, of all threads together) and counts of one pair in the last frame."""

    milliseconds: float
    candidate_pairs: int
    feature_pairs: int
    exact_decisions: int
    contacts: int


@dataclass(frozen=True, kw_only=True)
class OctreeStatistics:
    """Sizes of all octrees together. nodes_by_depth has one entry per level."""

    nodes_in_use: int
    nodes_allocated: int
    blocks_in_use: int
    blocks_free: int
    blocks_allocated: int
    deepest_level: int
    elements: int
    max_elements_in_node: int
    nodes_by_depth: list[int]
    elements_by_depth: list[int]
    bytes: int


@dataclass(frozen=True, kw_only=True)
class Validity:
    """Whether the last answer for a pair can be trusted, and why not.

    Docs/HowTo/Validity.md says what to do in each case. Lengths are in L. Lists hold indices,
    ascending.
    """

    trusted: bool = False
    started_apart: bool = False
    side_may_be_wrong: bool = True
    unwelded: bool = False
    method: Method = Method.AUTO
    reason: MethodReason = MethodReason.REQUESTED
    at_end: int = 0
    at_impact: int = 0
    displacement: float = 0.0
    displacement_limit: float = 0.0
    arc_deviation: float = 0.0
    effective_thickness: float = 0.0
    proxy_depth: float = 0.0
    age: int = 0
    advance_may_be_missing: bool = False
    untrusted_vertices_a: list[int]
    untrusted_vertices_b: list[int]
    degenerate_triangles_a: list[int]
    degenerate_triangles_b: list[int]
    outside_band: list[int]
    near_threshold: list[int]
    unreliable_sign: list[int]

    @property
    def displacement_over_limit(self) -> float:
        """Above 1: the motion violates the condition of Proximity or Intersection."""
        if self.displacement <= 0:
            return 0.0
        limit = self.displacement_limit
        return self.displacement / limit if limit else float("inf")
