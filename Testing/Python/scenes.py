"""Meshes and scenes that the tests share."""

from typing import Any

import numpy as np
import numpy.typing as npt

import palpate

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.uint32]

TETRAHEDRON = np.array([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, -30]], dtype=np.float64)
TETRAHEDRON_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], dtype=np.uint32)
BLADE = np.array([[5, 5, 1], [5, -9, 8], [5, 9, 8]], dtype=np.float64)
BLADE_MOVED = BLADE - [0, 0, 4]
BLADE_TRIANGLES = np.array([[0, 1, 2]], dtype=np.uint32)


def ball(
    rows: int, radius: float = 1.0, centre: npt.ArrayLike = (0, 0, 0)
) -> tuple[Floats, Indices]:
    """A closed mesh of a sphere, wound outward: 4 rows (rows - 1) triangles."""
    columns = 2 * rows
    polar = np.pi * np.arange(1, rows) / rows
    azimuth = 2 * np.pi * np.arange(columns) / columns
    ring = np.stack(
        [
            np.outer(np.sin(polar), np.cos(azimuth)),
            np.outer(np.sin(polar), np.sin(azimuth)),
            np.outer(np.cos(polar), np.ones(columns)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    positions = np.concatenate([[[0, 0, 1]], ring, [[0, 0, -1]]])
    last = len(positions) - 1
    triangles = []
    for c in range(columns):
        d = (c + 1) % columns
        triangles.append([0, 1 + c, 1 + d])
        for r in range(rows - 2):
            p, q = 1 + r * columns, 1 + (r + 1) * columns
            triangles += [[p + c, q + c, q + d], [p + c, q + d, p + d]]
        p = 1 + (rows - 2) * columns
        triangles.append([p + c, last, p + d])
    return radius * positions + np.asarray(centre), np.array(triangles, dtype=np.uint32)


def same(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> bool:
    """Whether two arrays have the same bits. Records may differ in bytes between fields."""
    if a.dtype.names is None:
        return a.tobytes() == b.tobytes()
    return all(same(a[name], b[name]) for name in a.dtype.names)


class Cut:
    """A blade that moves through the face of a tetrahedron in one step."""

    def __init__(self, **settings: object) -> None:
        self.collisions = palpate.OctreeBasedCD()
        self.blade = self.collisions.add_triangle_mesh(BLADE, BLADE_TRIANGLES)
        self.organ = self.collisions.add_triangle_mesh(TETRAHEDRON, TETRAHEDRON_TRIANGLES)
        keywords = {"thickness": 0.5, **settings}
        self.collisions.add_collision_pair(self.blade, self.organ, **keywords)
        self.collisions.set_positions(self.blade, BLADE, BLADE_MOVED)

    def detect(self) -> palpate.CollisionData:
        self.collisions.detect_collision()
        return self.collisions.collision_data(self.blade, self.organ)


class Balls:
    """Two balls that overlap a little more in each step."""

    def __init__(self, rows: int = 12, **settings: object) -> None:
        self.collisions = palpate.OctreeBasedCD(**settings)
        self.positions, self.triangles = ball(rows)
        self.a = self.collisions.add_triangle_mesh(self.positions, self.triangles)
        self.b = self.collisions.add_triangle_mesh(self.positions + [2.05, 0, 0], self.triangles)
        self.collisions.add_collision_pair(self.a, self.b, method="proximity", thickness=0.2)

    def step(self, number: int) -> palpate.CollisionData:
        self.collisions.set_positions(self.b, self.positions + [2.05 - 0.001 * number, 0, 0])
        self.collisions.detect_collision()
        data = self.collisions.collision_data(self.a, self.b)
        self.collisions.advance()
        return data
