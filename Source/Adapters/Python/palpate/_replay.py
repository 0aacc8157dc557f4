"""The 3D view of a report: bodies and findings of some frames, as _report.html reads them."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._captures import element_of
from palpate._errors import BadInput
from palpate._frames import Mesh, Reader
from palpate._results import FloatArray, IndexArray
from palpate._sequence import Sequence

MOST_BYTES = 7_500_000
MOST_FRAMES = 400
MOST_FINDINGS = 500  # in a frame
# Pale, so that findings stand out. Colour-blind readers can tell neighbours apart by lightness.
COLOURS = ("#8fbcd9", "#f0c987", "#a8cfae", "#d9b3cf", "#6f93ad", "#c9c3b8")
DIGITS = np.array([c for c in range(32, 127) if chr(c) not in '"<\\'], np.uint8)
STEPS = len(DIGITS) ** 2 - 1


def digits_of(numbers: npt.ArrayLike) -> str:
    """Numbers as text: their width as a digit, then that many digits of each."""
    values = np.asarray(numbers, np.int64).ravel()
    width = 1
    while values.size and values.max() >= len(DIGITS) ** width:
        width += 1
    powers = len(DIGITS) ** np.arange(width - 1, -1, -1)
    places = values[:, None] // powers % len(DIGITS)
    return str(np.append(DIGITS[width], DIGITS[places]).tobytes(), "ascii")


class _Blocks:
    """Texts of the page. Content that frames share is there once."""

    def __init__(self) -> None:
        self.indices: dict[str, int] = {}
        self.bytes = 0

    def add(self, numbers: npt.ArrayLike) -> int:
        text = digits_of(numbers)
        if text not in self.indices:
            self.bytes += len(text)
            self.indices[text] = len(self.indices)
        return self.indices[text]


def rgb(colour: str) -> list[float]:
    return [round(int(colour[i : i + 2], 16) / 255, 3) for i in (1, 3, 5)]


def replay_of(
    sequence: Sequence,
    reader: Reader,
    table: Path,
    important: Iterable[int],
    colours: dict[str, str],
) -> dict[str, Any]:
    """Frames for the page: the important ones, and others at equal distances, as many as fit.

    table      findings.csv
    important  frame numbers, the most important first
    colours    of kinds of findings
    """
    numbers, blocks = sequence.numbers, _Blocks()
    shapes: dict[str, Mesh] = {}
    for body in sequence.bodies:
        for number in numbers:
            try:
                shapes[body.name] = reader.mesh(body, number)
                break
            except BadInput:
                continue
    moving = [b.name for b in sequence.bodies if b.name in shapes and b.still is None]
    each = 6 * sum(len(shapes[name].positions) for name in moving) + 200
    fixed = sum(6 * len(m.positions) + 9 * len(_polygons(m)) for m in shapes.values())
    count = min(MOST_FRAMES, len(numbers), (MOST_BYTES - fixed) // each)
    if count < 1:
        return {"frames": [], "notes": ["The frames are too large for the 3D view."]}
    chosen = dict.fromkeys([*important][: (count + 1) // 2])
    even = np.linspace(0, len(numbers) - 1, count).round().astype(int)
    for at in even.tolist():
        if len(chosen) < count:
            chosen[numbers[at]] = None
    findings = _findings_in(table, chosen)
    frames = []
    for number in sorted(chosen):
        meshes: dict[str, Mesh] = {}
        for body in sequence.bodies:
            try:
                meshes[body.name] = reader.mesh(body, number)
            except BadInput:
                continue
        bodies = [
            _placed(meshes[b.name], blocks) if b.name in meshes else None for b in sequence.bodies
        ]
        marks = [_mark(row, meshes, colours) for row in findings.get(number, [])]
        frames.append(
            {
                "at": numbers.index(number),
                "bodies": bodies,
                "findings": [mark for mark in marks if mark is not None],
            }
        )
        if blocks.bytes > MOST_BYTES:
            break
    return {
        "unit": "",
        "from": [0.5, -1.0, 0.6],
        "frames": frames,
        "blocks": list(blocks.indices),
        "bodies": [
            {
                "name": body.name,
                "shape": _SHAPES[shapes[body.name].element] if body.name in shapes else "points",
                "element": shapes[body.name].element if body.name in shapes else "",
                "ids": body.name in shapes and shapes[body.name].element == "triangle",
                "colour": rgb(COLOURS[index % len(COLOURS)]),
                "opacity": 1.0,
                "radius": body.radius,
            }
            for index, body in enumerate(sequence.bodies)
        ],
    }


_SHAPES = {
    "tetrahedron": "triangles",
    "triangle": "triangles",
    "segment": "lines",
    "point": "points",
}


def _polygons(mesh: Mesh) -> IndexArray:
    """Elements; the outer faces of tetrahedra; none of points."""
    if mesh.element == "point":
        return mesh.elements[:0]
    if mesh.element != "tetrahedron":
        return mesh.elements
    faces = mesh.elements[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]].reshape(-1, 3)
    ordered = np.sort(faces, axis=1)
    _, inverse, counts = np.unique(ordered, axis=0, return_inverse=True, return_counts=True)
    outer: IndexArray = faces[counts[inverse.ravel()] == 1]
    return outer


def _placed(mesh: Mesh, blocks: _Blocks) -> dict[str, Any]:
    low = mesh.positions.min(axis=0)
    size = mesh.positions.max(axis=0) - low
    shares = (mesh.positions - low) / np.where(size > 0, size, 1)
    return {
        "block": blocks.add(np.rint(STEPS * shares)),
        "box": [float(f"{x:.6g}") for x in (*low, *size)],
        "elements": blocks.add(_polygons(mesh)),
    }


def _findings_in(table: Path, frames: dict[int, None]) -> dict[int, list[dict[str, str]]]:
    found: dict[int, list[dict[str, str]]] = {}
    with table.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            rows = found.setdefault(int(row["frame"]), []) if int(row["frame"]) in frames else []
            if len(rows) < MOST_FINDINGS:
                rows.append(row)
    return found


def _mark(
    row: dict[str, str], meshes: dict[str, Mesh], colours: dict[str, str]
) -> list[Any] | None:
    """Position, text and colour of a finding, or None without an element."""
    places: list[FloatArray] = []
    for name, feature in (("body_a", "element_a"), ("body_b", "element_b")):
        mesh = meshes.get(row[name])
        if mesh is not None and row[feature]:
            places.append(_middle(mesh, row[feature]))
    if not places:
        return None
    sides = [f"{row[b]} {row[e]}" for b, e in (("body_a", "element_a"), ("body_b", "element_b"))]
    text = f"{row['kind']}: " + ", ".join(side.strip() for side in sides if side.strip())
    text += "".join(
        f", {name} {float(row[key]):.6g}"
        for key, name in (("depth", "depth"), ("time_of_impact", "time of impact"))
        if row[key]
    )
    smallest = min(places, key=len)  # a vertex is a better place than a triangle
    middle = [float(f"{x:.6g}") for x in smallest.mean(axis=0)]
    text += f" ({row['text']})" if row["text"] else ""
    return [*middle, text, rgb(colours[row["kind"]])]


def _middle(mesh: Mesh, feature: str) -> FloatArray:
    """The corners of a feature, as "vertex 5" or "triangle 12"."""
    kind, *numbers = feature.split()
    vertices: npt.ArrayLike = [int(n) for n in numbers]
    if kind not in ("vertex", "edge"):
        vertices = mesh.elements[element_of(mesh, feature)]
    corners: FloatArray = mesh.positions[np.asarray(vertices)]
    return corners
