"""Meshes by the conventions of meshio and trimesh."""

from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._enums import ErrorCode
from palpate._errors import Error
from palpate._palpate import OctreeBasedCD, triangles_of_quads
from palpate._results import MeshArrays


def add(collisions: OctreeBasedCD, mesh: Any, radius: npt.ArrayLike = 0.0) -> int:
    """Adds a mesh object to an OctreeBasedCD and returns its id.

    mesh    MeshArrays of read_mesh_file(); or it has `vertices` and `faces`, as those of trimesh;
            or `points` and `cells`, as those of meshio. Cells of the highest dimension count:
            tetrahedra, or triangles and quads, or lines, or points.
    radius  L, of lines and points: a number, or (n,) one per vertex
    """
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return _add_faces(collisions, mesh.vertices, [np.asarray(mesh.faces)])
    if isinstance(mesh, MeshArrays):
        points = mesh.positions
        cells = _cells_by_type(
            {
                "tetra": mesh.tetrahedra,
                "triangle": mesh.triangles,
                "line": mesh.segments,
                "vertex": mesh.points,
            }
        )
    elif hasattr(mesh, "points") and hasattr(mesh, "cells"):
        points = np.asarray(mesh.points, dtype=np.float64)
        if points.ndim == 2 and points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        cells = _cells_by_type(mesh.cells)
    else:
        kind = type(mesh).__name__
        raise TypeError(f"{kind} has neither vertices and faces nor points and cells")
    if "tetra" in cells:
        return collisions.add_tetrahedral_mesh(points, np.concatenate(cells["tetra"]))
    faces = cells.get("triangle", []) + cells.get("quad", [])
    if faces:
        return _add_faces(collisions, points, faces)
    if "line" in cells:
        return collisions.add_line_mesh(points, np.concatenate(cells["line"]), radius)
    if "vertex" in cells:
        return collisions.add_point_set(points, radius)
    known = ", ".join(sorted(cells)) or "none"
    raise Error(f"The mesh has no cells that collide: {known}.", ErrorCode.UNSUPPORTED_METHOD)


def _add_faces(
    collisions: OctreeBasedCD, points: npt.ArrayLike, faces: list[npt.NDArray[Any]]
) -> int:
    triangles = [
        triangles_of_quads(block) if block.ndim == 2 and block.shape[1] == 4 else block
        for block in faces
    ]
    return collisions.add_triangle_mesh(points, np.concatenate(triangles))


def _cells_by_type(cells: Any) -> dict[str, list[npt.NDArray[Any]]]:
    """Blocks of cells by their type, from CellBlock objects, (type, data) pairs or a dict."""
    result: dict[str, list[npt.NDArray[Any]]] = {}
    blocks = cells.items() if hasattr(cells, "items") else cells
    for block in blocks:
        kind, data = (block.type, block.data) if hasattr(block, "data") else block
        if len(data) > 0:
            result.setdefault(str(kind), []).append(np.asarray(data))
    return result
