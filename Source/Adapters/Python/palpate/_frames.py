"""Reading the frames of a sequence."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from palpate._errors import BadInput, Error
from palpate._npz import ELEMENTS, NpzRows, array_of, name_of_positions, opened
from palpate._palpate import read_mesh_file, weld
from palpate._results import FloatArray, IndexArray, MeshArrays
from palpate._sequence import Body, Sequence, Source


class Mesh(NamedTuple):
    """A body in one frame: its elements of the highest dimension.

    element    "tetrahedron", "triangle", "segment" or "point"
    positions  (n, 3), L
    elements   (m, 4), (m, 3), (m, 2) or (m, 1)
    ignored    elements of lower dimensions that the file has besides
    """

    element: str
    positions: FloatArray
    elements: IndexArray
    ignored: int = 0

    def same_topology(self, other: "Mesh") -> bool:
        return (
            self.element == other.element
            and len(self.positions) == len(other.positions)
            and np.array_equal(self.elements, other.elements)
        )


class Reader:
    """Reads frames. It keeps an open NPZ file for each body, and no frames but the first.

    STL files and bodies with the option `weld` get the joined vertices of the first frame in all
    frames with the same triangles. What it reads does not depend on the frames read before.
    """

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence
        self._still: dict[str, Mesh] = {}
        self._rows: dict[str, NpzRows] = {}
        self._welds: dict[str, tuple[IndexArray, IndexArray, IndexArray] | None] = {}

    def mesh(self, body: Body, number: int) -> Mesh:
        """Raises BadInput."""
        if body.name in self._still:
            return self._still[body.name]
        where = f'frame {number}, body "{body.name}"'
        source = body.still or body.sources.get(number)
        if source is None:
            raise BadInput(f"{where}: there is no file")
        try:
            mesh = _highest(self._welded(body, self._arrays(body, source)))
        except (Error, BadInput) as error:
            raise BadInput(f"{where}: {error}") from None
        except OSError as error:
            raise BadInput(f"{where}: {source.path}: {error}") from None
        if body.still is not None:
            self._still[body.name] = mesh
        return mesh

    def _arrays(self, body: Body, source: Source) -> MeshArrays:
        if Path(source.path).suffix.lower() != ".npz":
            return read_mesh_file(source.path)
        if source.row is None:
            with opened(source.path) as archive:
                name = name_of_positions(archive, source.body)
                positions = array_of(archive, source.path, name)
        else:
            rows = self._rows.get(body.name)
            if rows is None or rows.path != source.path:
                rows = self._rows[body.name] = NpzRows(source.path, source.body)
            positions = rows.row(source.row)
        (bad, *_) = np.flatnonzero(~np.isfinite(positions).all(axis=1)).tolist() or [None]
        if bad is not None:
            raise BadInput(f"{source.path}: the position of vertex {bad} is not finite")
        if body.topology is not None:
            return read_mesh_file(body.topology)._replace(positions=positions)
        with opened(source.path) as archive:
            arrays = {}
            for name, (element, width) in ELEMENTS.items():
                if f"{source.body}{name}.npy" in archive.namelist():
                    values = array_of(archive, source.path, source.body + name)
                    if values.ndim != 2 or values.shape[1] != width:
                        where = f"{source.path}, {source.body}{name}"
                        raise BadInput(f"{where}: shape {values.shape}; it must be (n, {width})")
                    arrays[element] = values
        return MeshArrays(
            positions,
            arrays.get("triangle", np.empty((0, 3), np.uint32)),
            arrays.get("tetrahedron", np.empty((0, 4), np.uint32)),
            arrays.get("segment", np.empty((0, 2), np.uint32)),
            np.empty(0, np.uint32) if arrays else np.arange(len(positions), dtype=np.uint32),
        )

    def _welded(self, body: Body, mesh: MeshArrays) -> MeshArrays:
        source = body.still or next(iter(body.sources.values()))
        distance = body.weld
        if distance is None and source.path.lower().endswith(".stl"):
            distance = 0.0
        if distance is None or len(mesh.triangles) == 0 or len(mesh.tetrahedra) > 0:
            return mesh
        if body.name not in self._welds:
            self._welds[body.name] = self._weld_of_first_frame(body, distance)
        kept = self._welds[body.name]
        if kept is not None and np.array_equal(mesh.triangles, kept[0]):
            _, triangles, vertex_of = kept
            positions = np.empty((int(vertex_of.max()) + 1, 3))
            positions[vertex_of[::-1]] = mesh.positions[::-1]  # the first of joined vertices
            if distance > 0 or np.array_equal(positions[vertex_of], mesh.positions):
                return mesh._replace(positions=positions, triangles=triangles)
        joined = weld(mesh.positions, mesh.triangles, distance)
        return mesh._replace(positions=joined.positions, triangles=joined.triangles)

    def _weld_of_first_frame(
        self, body: Body, distance: float
    ) -> tuple[IndexArray, IndexArray, IndexArray] | None:
        source = body.still or body.sources.get(self._sequence.numbers[0])
        if source is None:
            return None
        try:
            mesh = self._arrays(body, source)
            joined = weld(mesh.positions, mesh.triangles, distance)
        except (Error, BadInput, OSError):
            return None  # that frame is reported by whoever checks it
        return mesh.triangles, joined.triangles, joined.vertex_of


def _highest(mesh: MeshArrays) -> Mesh:
    """Elements of the highest dimension; the surface triangles of tetrahedra do not count."""
    counts = [len(mesh.tetrahedra), len(mesh.triangles), len(mesh.segments), len(mesh.points)]
    if counts[0] > 0:
        return Mesh("tetrahedron", mesh.positions, mesh.tetrahedra, sum(counts[2:]))
    if counts[1] > 0:
        return Mesh("triangle", mesh.positions, mesh.triangles, sum(counts[2:]))
    if counts[2] > 0:
        return Mesh("segment", mesh.positions, mesh.segments)
    if counts[3] > 0:
        positions = mesh.positions[mesh.points]
        return Mesh("point", positions, np.arange(len(positions), dtype=np.uint32)[:, None])
    raise BadInput("the mesh has no elements")
