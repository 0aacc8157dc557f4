"""The bodies of a frame in an OctreeBasedCD, and the features of their contacts."""

from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._exact import orientations
from palpate._frames import Mesh
from palpate._palpate import CollisionData, OctreeBasedCD, find_mesh_defects
from palpate._results import IndexArray
from palpate._sequence import Body

# Times of impact are early by at most this: the default of PairSettings.time_tolerance.
_TIME_TOLERANCE = 1e-6


class PlacedBody:
    """A body in the OctreeBasedCD.

    steps    whether its step is known: the frame before has the same elements
    start    positions at the start of the step, (n, 3)
    surface  of lines: their segments as triangles {p, q, q}, for tests against triangles
    owners   of a tetrahedral mesh: the tetrahedron of each triangle
    """

    def __init__(self, collisions: OctreeBasedCD, body: Body, mesh: Mesh) -> None:
        self.body, self.mesh, self.start = body, mesh, mesh.positions
        self.steps = False
        self.owners: IndexArray | None = None
        self.closed = False
        if mesh.element == "tetrahedron":
            self.id = collisions.add_tetrahedral_mesh(mesh.positions, mesh.elements)
            surface = collisions.surface(self.id)
            self.triangles, self.owners, self.closed = *surface, True
        elif mesh.element == "triangle":
            self.id = collisions.add_triangle_mesh(mesh.positions, mesh.elements)
            self.triangles = mesh.elements
            self.closed = find_mesh_defects(mesh.elements).closed
        elif mesh.element == "segment":
            self.id = collisions.add_line_mesh(mesh.positions, mesh.elements, body.radius)
            self.triangles = np.ascontiguousarray(mesh.elements[:, [0, 1, 1]])
        else:
            self.id = collisions.add_point_set(mesh.positions, body.radius)
            self.triangles = np.repeat(mesh.elements, 3, axis=1)
        self.surface = self.id
        if mesh.element == "segment":
            self.surface = collisions.add_triangle_mesh(mesh.positions, self.triangles)
        collisions.set_name(self.id, body.name)

    def element(self, triangle: int) -> str:
        if self.owners is not None:
            return f"tetrahedron {self.owners[triangle]}"
        return f"{self.mesh.element} {triangle}"

    def step(self, collisions: OctreeBasedCD, mesh: Mesh) -> None:
        """From the positions now to those of a mesh with the same elements."""
        self.start, self.mesh, self.steps = self.mesh.positions, mesh, True
        for geometry in {self.id, self.surface}:
            collisions.set_positions(geometry, self.start, mesh.positions)

    @property
    def is_surface(self) -> bool:
        return self.mesh.element in ("triangle", "tetrahedron")

    @property
    def radius(self) -> float:
        return 0.0 if self.is_surface else self.body.radius


class Features:
    """The contacts of vertices and edges of two bodies, of all lists in their order.

    elements   the features of each contact, by name
    times      (n,) of impact, in [0, 1] of the step
    distances  (n,), L
    """

    def __init__(self, a: PlacedBody, b: PlacedBody, data: CollisionData) -> None:
        self._bodies = (a,) if a is b else (a, b)
        first_b = 0 if a is b else len(a.mesh.positions)
        self._ids = data.stencils(0, first_b).ids
        lists = (data.vertex_triangle, data.triangle_vertex, data.edge_edge)
        self.times = np.concatenate([contacts["time_of_impact"] for contacts in lists])
        self.distances = np.concatenate([contacts["distance"] for contacts in lists])
        self.elements = [
            (f"vertex {c['vertex']}", b.element(c["triangle"])) for c in data.vertex_triangle
        ]
        self.elements += [
            (a.element(c["triangle"]), f"vertex {c['vertex']}") for c in data.triangle_vertex
        ]
        self.elements += [(_edge(c["edge_a"]), _edge(c["edge_b"])) for c in data.edge_edge]

    def touch(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the features touch where the step starts or ends, decided exactly.

        They are then not known to pass each other within the step.
        """
        result = np.zeros(len(self.times), dtype=bool)
        starts = np.concatenate([body.start for body in self._bodies])
        ends = np.concatenate([body.mesh.positions for body in self._bodies])
        for near, positions in (
            (self.times == 0, starts),
            (self.times >= 1 - 2 * _TIME_TOLERANCE, ends),
        ):
            corners = positions[self._ids[near]].transpose(1, 0, 2)
            result[near] |= orientations(corners[0], corners[1], corners[2], corners[3]) == 0
        return result


def _edge(vertices: npt.NDArray[Any]) -> str:
    return f"edge {vertices[0]} {vertices[1]}"
