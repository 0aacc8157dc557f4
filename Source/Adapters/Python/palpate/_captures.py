"""Captures of a few elements that show a finding again."""

import re
from pathlib import Path

import numpy as np

from palpate._enums import Method
from palpate._errors import BadInput
from palpate._findings import INSIDE, RADII, Finding
from palpate._frames import Mesh, Reader
from palpate._palpate import OctreeBasedCD, capture
from palpate._results import FloatArray, IndexArray
from palpate._sequence import Body, Sequence


class Part:
    """Some elements of a body, with their vertices at both ends of the step."""

    def __init__(self, body: Body, before: Mesh, now: Mesh, elements: IndexArray) -> None:
        self.body, self.element = body, now.element
        vertices, ids = np.unique(now.elements[elements], return_inverse=True)
        self.elements = ids.reshape(-1, now.elements.shape[1])
        self.before: FloatArray = before.positions[vertices]
        self.now: FloatArray = now.positions[vertices]

    def add(self, collisions: OctreeBasedCD, as_triangles: bool) -> int:
        """as_triangles: segments become the triangles {p, q, q}."""
        if self.element == "tetrahedron":
            geometry = collisions.add_tetrahedral_mesh(self.now, self.elements)
        elif self.element == "triangle":
            geometry = collisions.add_triangle_mesh(self.now, self.elements)
        elif self.element == "segment" and as_triangles:
            geometry = collisions.add_triangle_mesh(self.now, self.elements[:, [0, 1, 1]])
        elif self.element == "segment":
            geometry = collisions.add_line_mesh(self.now, self.elements, self.body.radius)
        else:
            geometry = collisions.add_point_set(self.now, self.body.radius)
        collisions.set_name(geometry, self.body.name)
        collisions.set_positions(geometry, self.before, self.now)
        return geometry


def step_of(
    sequence: Sequence, reader: Reader, finding: Finding
) -> tuple[dict[str, Mesh], dict[str, Mesh]]:
    """The bodies of a finding at both ends of the step; at rest if the step is not known."""
    bodies = {body.name: body for body in sequence.bodies}
    index = sequence.numbers.index(finding.frame)
    names = dict.fromkeys(name for name in (finding.body_a, finding.body_b) if name)
    now = {name: reader.mesh(bodies[name], finding.frame) for name in names}
    before = dict(now)
    for name in names if index > 0 else ():
        try:
            mesh = reader.mesh(bodies[name], sequence.numbers[index - 1])
        except BadInput:
            continue
        if mesh.same_topology(now[name]):
            before[name] = mesh
    return before, now


def write_capture_of(sequence: Sequence, reader: Reader, finding: Finding, folder: Path) -> Path:
    """Writes the elements of a finding to a capture, and returns its path."""
    bodies = {body.name: body for body in sequence.bodies}
    before, now = step_of(sequence, reader, finding)
    names = list(now)
    chosen = {name: set[int]() for name in names}
    chosen[finding.body_a].add(element_of(now[finding.body_a], finding.element_a))
    if finding.text == INSIDE:
        chosen[finding.body_b].update(range(len(now[finding.body_b].elements)))
    elif finding.body_b:
        chosen[finding.body_b].add(element_of(now[finding.body_b], finding.element_b))
    method = Method.CONTINUOUS
    if finding.kind in ("penetration", "self-intersection"):
        method = Method.PROXIMITY if finding.text == RADII else Method.INTERSECTION
    collisions = OctreeBasedCD()
    ids = []
    for name in names:
        part = Part(bodies[name], before[name], now[name], np.array(sorted(chosen[name])))
        ids.append(part.add(collisions, as_triangles=method is Method.INTERSECTION))
    if finding.body_b:
        collisions.add_collision_pair(ids[0], ids[-1], method=method)
    collisions.detect_collision()
    name = "-".join([f"frame{finding.frame:06d}", *names, finding.kind])
    path = folder / (re.sub(r"[^\w.-]", "_", name) + ".txt")
    capture(collisions, path)
    return path


def element_of(mesh: Mesh, feature: str) -> int:
    """The first element of a mesh that has a feature."""
    kind, *numbers = feature.split()
    if kind == mesh.element:
        return int(numbers[0])
    has = [(mesh.elements == int(vertex)).any(axis=1) for vertex in numbers]
    return int(np.flatnonzero(np.logical_and.reduce(has))[0])
