"""What is wrong in the frames of a sequence, decided by the library."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from palpate._bodies import Features, PlacedBody
from palpate._enums import Method
from palpate._errors import BadInput, Error
from palpate._exact import Signs, orientations
from palpate._frames import Mesh, Reader
from palpate._palpate import CollisionData, OctreeBasedCD
from palpate._sequence import Body, Sequence

KINDS = {
    "penetration": "the surfaces of two bodies pierce each other, or a vertex is inside a body",
    "crossing": "features of two bodies meet within the step",
    "self-intersection": "the surface of a body pierces itself",
    "self-crossing": "features of one body meet within the step",
    "inverted": "a tetrahedron has turned inside out, or is flat",
    "topology": "elements or their number changed: the step of the body is not checked",
    "touch": "surfaces have a common point, but do not pierce each other",
    "unreadable": "the frame of a body is missing or wrong: it is not checked",
}
# Texts of penetrations: of a vertex inside a closed body, and of elements that have radii.
INSIDE = "inside"
RADII = "radii"


class Finding(NamedTuple):
    """One row of the table. Elements are "vertex 5", "edge 3 7", "triangle 12" and so on.

    frame  the number of the frame; of a crossing the frame that ends the step
    time   of the impact, in [0, 1] of the step; NaN: at the frame
    depth  L: how deep the deepest vertex of the elements is behind the surface; NaN: not known
    """

    frame: int
    kind: str
    body_a: str
    element_a: str = ""
    body_b: str = ""
    element_b: str = ""
    time: float = float("nan")
    depth: float = float("nan")
    text: str = ""

    @property
    def group(self) -> tuple[int, str, str, str]:
        """Findings of one kind between two bodies in one frame."""
        return self.frame, self.kind, self.body_a, self.body_b


class Checker:
    """Checks frames in their order. The answers do not depend on the frame where it starts.

    Two frames are in memory at a time.
    """

    def __init__(self, sequence: Sequence, threads: int = 0) -> None:
        self._sequence = sequence
        self._reader = Reader(sequence)
        self._collisions = OctreeBasedCD(threads=threads)
        self._placed: dict[str, PlacedBody] = {}
        self._signs: dict[str, int] = {}
        self._first = sequence.numbers[0]
        self.notes: set[str] = set()

    def check(self, first: int, last: int) -> Iterator[list[Finding]]:
        """The findings of each frame of numbers[first:last] and of the step that ends there."""
        numbers = self._sequence.numbers
        before: dict[str, Mesh] = {}
        if first > 0:
            before = self._read(numbers[first - 1], [])
            self._place(before, {}, numbers[first - 1], [])
        for number in numbers[first:last]:
            found: list[Finding] = []
            now = self._read(number, found)
            self._place(now, before, number, found)
            tests = [
                (self._placed[a], self._placed[b])
                for a, b in self._sequence.pairs
                if a in self._placed and b in self._placed
            ]
            if number != self._first:  # bodies at rest were tested in the first frame
                tests = [(a, b) for a, b in tests if a.body.still is None or b.body.still is None]
            self._find_crossings(tests, number, found)
            self._find_intersections(tests, number, found)
            self._find_inverted(number, found)
            yield found
            before = now

    def _read(self, number: int, found: list[Finding]) -> dict[str, Mesh]:
        meshes = {}
        for body in self._sequence.bodies:
            try:
                mesh = meshes[body.name] = self._reader.mesh(body, number)
                if mesh.ignored:
                    text = f'body "{body.name}": lines and points beside its elements do not count'
                    self.notes.add(text)
            except BadInput as error:
                found.append(Finding(number, "unreadable", body.name, text=str(error)))
        return meshes

    def _place(
        self, now: dict[str, Mesh], before: dict[str, Mesh], number: int, found: list[Finding]
    ) -> None:
        """Sets the step of each body. One that is new or has changed has none."""
        for body in self._sequence.bodies:
            name, mesh, old = body.name, now.get(body.name), before.get(body.name)
            placed = self._placed.get(name)
            if mesh is not None and placed is not None and mesh.same_topology(placed.mesh):
                placed.step(self._collisions, mesh)
                continue
            if mesh is not None and old is not None:
                found.append(Finding(number, "topology", name, text=_change(old, mesh)))
            if placed is not None:
                for geometry in {placed.id, placed.surface}:
                    self._collisions.remove_geometry(geometry)
                del self._placed[name]
            if mesh is not None:
                try:
                    self._placed[name] = PlacedBody(self._collisions, body, mesh)
                except Error as error:
                    text = f'frame {number}, body "{name}": {error}'
                    found.append(Finding(number, "unreadable", name, text=text))
                    del now[name]

    def _detect(self, tests: list[tuple[int, int, dict[str, Any]]]) -> list[CollisionData]:
        """The answers for pairs of geometries with these settings."""
        there = {(pair.a, pair.b) for pair in self._collisions.pairs()}
        for a, b, settings in tests:
            if (a, b) in there:
                self._collisions.set_pair_settings(a, b, **settings)
            else:
                self._collisions.add_collision_pair(a, b, **settings)
        for a, b in there - {(a, b) for a, b, _ in tests}:
            self._collisions.remove_collision_pair(a, b)
        self._collisions.detect_collision()
        return [self._collisions.collision_data(a, b) for a, b, _ in tests]

    def _find_crossings(
        self, tests: list[tuple[PlacedBody, PlacedBody]], number: int, found: list[Finding]
    ) -> None:
        tests = [(a, b) for a, b in tests if a.steps and b.steps]
        answers = self._detect(
            [(a.id, b.id, {"method": Method.CONTINUOUS, **_rest(a, b)}) for a, b in tests]
        )
        for (a, b), data in zip(tests, answers, strict=True):
            kind = "self-crossing" if a is b else "crossing"
            features = Features(a, b, data)
            touching = features.touch()
            for row, (element_a, element_b) in enumerate(features.elements):
                time, distance = float(features.times[row]), float(features.distances[row])
                if time == 0 and distance < 0:
                    continue  # radii that overlap where the step starts: found in that frame
                found.append(
                    Finding(
                        number,
                        "touch" if touching[row] else kind,
                        *(a.body.name, element_a, b.body.name, element_b),
                        time=time,
                    )
                )

    def _find_intersections(
        self, tests: list[tuple[PlacedBody, PlacedBody]], number: int, found: list[Finding]
    ) -> None:
        # Lines have no intersections, but their segments have, as triangles {p, q, q}.
        piercing = [
            (a, b)
            for a, b in tests
            if (a.is_surface or b.is_surface) and "point" not in (a.mesh.element, b.mesh.element)
        ]
        overlapping = [(a, b) for a, b in tests if a.radius + b.radius > 0]
        intersection: dict[str, Any] = {"method": Method.INTERSECTION}
        answers = self._detect(
            [(a.surface, b.surface, intersection) for a, b in piercing]
            + [(a.id, b.id, {"method": Method.PROXIMITY, **_rest(a, b)}) for a, b in overlapping]
        )
        for a, b in tests:
            if a is not b:
                _find_inside(self._collisions, a, b, number, found)
                _find_inside(self._collisions, b, a, number, found)
        for (a, b), data in zip(piercing, answers, strict=False):
            _find_piercing(self._collisions, a, b, data, number, found)
        for (a, b), data in zip(overlapping, answers[len(piercing) :], strict=True):
            _find_overlaps(a, b, data, number, found)

    def _find_inverted(self, number: int, found: list[Finding]) -> None:
        for name, placed in self._placed.items():
            if placed.owners is None or (placed.body.still and number != self._first):
                continue
            signs = _orientations_of(placed.mesh)
            for tetrahedron in np.flatnonzero(signs != self._sign(placed.body, signs)):
                text = "flat" if signs[tetrahedron] == 0 else ""
                element = f"tetrahedron {tetrahedron}"
                found.append(Finding(number, "inverted", name, element, text=text))

    def _sign(self, body: Body, signs: Signs) -> int:
        """The orientation of most tetrahedra in the first frame."""
        if body.name not in self._signs:
            try:
                first = self._reader.mesh(body, self._first)
                if first.element == "tetrahedron":
                    signs = _orientations_of(first)
            except BadInput:  # that frame is reported by who checks it
                return 1 if signs.sum(dtype=int) >= 0 else -1
            self._signs[body.name] = 1 if signs.sum(dtype=int) >= 0 else -1
        return self._signs[body.name]


def _change(old: Mesh, new: Mesh) -> str:
    counts = [
        f"{len(mesh.positions)} vertices and {len(mesh.elements)} elements ({mesh.element})"
        for mesh in (old, new)
    ]
    if counts[0] == counts[1]:
        return f"{counts[0]}, but other vertices in the elements"
    return f"from {counts[0]} to {counts[1]}"


def _rest(a: PlacedBody, b: PlacedBody) -> dict[str, Any]:
    """Neighbours along a thread overlap by their radii. They are no contacts."""
    return {"rest_distance": 4 * a.radius} if a is b and a.mesh.element == "segment" else {}


def _orientations_of(mesh: Mesh) -> Signs:
    corners = mesh.positions[mesh.elements]
    return orientations(corners[:, 0], corners[:, 1], corners[:, 2], corners[:, 3])


def _find_inside(
    collisions: OctreeBasedCD,
    vertices: PlacedBody,
    body: PlacedBody,
    number: int,
    found: list[Finding],
) -> None:
    """Vertices inside a closed body, also where no surfaces intersect."""
    if not body.closed:
        return
    for row in collisions.queries().find_inside_vertices(vertices.id, body.id):
        found.append(
            Finding(
                number,
                "penetration",
                *(vertices.body.name, f"vertex {row['vertex']}"),
                *(body.body.name, body.element(row["triangle"])),
                depth=float(row["depth"]),
                text=INSIDE,
            )
        )


def _find_piercing(
    collisions: OctreeBasedCD,
    a: PlacedBody,
    b: PlacedBody,
    data: CollisionData,
    number: int,
    found: list[Finding],
) -> None:
    """Triangles that intersect, with the depth of their deepest corner."""
    triangles = data.intersecting_triangles
    corners_a, corners_b = a.triangles[triangles["a"]], b.triangles[triangles["b"]]
    pairs = np.stack([triangles["a"], triangles["b"]], axis=1)
    piercing = collisions.queries().pierce(a.surface, b.surface, pairs)
    depths = [np.zeros(len(body.mesh.positions)) for body in (a, b)]
    for of, contacts in zip(depths, (data.vertex_triangle, data.triangle_vertex), strict=True):
        np.maximum.at(of, contacts["vertex"], -contacts["distance"])
    if a is b:
        depths[1] = depths[0]
    deepest = np.maximum(depths[0][corners_a], depths[1][corners_b]).max(axis=1, initial=0)
    kind = "self-intersection" if a is b else "penetration"
    for row, pair in enumerate(triangles):
        found.append(
            Finding(
                number,
                kind if piercing[row] else "touch",
                *(a.body.name, a.element(pair["a"]), b.body.name, b.element(pair["b"])),
                depth=float(deepest[row]) if deepest[row] > 0 else float("nan"),
            )
        )


def _find_overlaps(
    a: PlacedBody, b: PlacedBody, data: CollisionData, number: int, found: list[Finding]
) -> None:
    """Features that are nearer than their radii."""
    features = Features(a, b, data)
    kind = "self-intersection" if a is b else "penetration"
    for elements, distance in zip(features.elements, features.distances, strict=True):
        names = (a.body.name, elements[0], b.body.name, elements[1])
        if distance < 0:
            found.append(Finding(number, kind, *names, depth=-float(distance), text=RADII))
        else:
            found.append(Finding(number, "touch", *names, text=RADII))
