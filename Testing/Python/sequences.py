"""Sequences of frames with known faults, for the tests of palpate-check."""

import pathlib

import numpy as np

import palpate
from scenes import BLADE_TRIANGLES, ball


def grid(columns, width=8.0, z=0.0):
    """A flat sheet of 2 columns^2 triangles about the z axis."""
    ids = np.arange((columns + 1) ** 2).reshape(columns + 1, columns + 1)
    x, y = np.meshgrid(*2 * [np.linspace(-width / 2, width / 2, columns + 1)])
    positions = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
    quads = np.stack([ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]], axis=-1)
    return positions, palpate.triangles_of_quads(quads.reshape(-1, 4))


def write(path, positions, triangles=(), **elements):
    triangles = np.asarray(triangles, np.uint32).reshape(-1, 3)
    palpate.write_mesh_file(path, palpate.MeshArrays(positions, triangles, **elements))


def pierced_membrane(folder, suffix=".vtp"):
    """A blade flies through triangle 3 of a membrane in the step to frame 6."""
    membrane, triangles = grid(4)
    blade = np.array([[-1.3, -2.9, 0.2], [-1.1, -2.9, 0.8], [-1.2, -2.7, 0.9]])
    for frame, height in enumerate([6, 5, 4, 3, 2, 1, -2, -3]):
        write(folder / f"membrane_{frame:02}{suffix}", membrane, triangles)
        write(folder / f"blade_{frame:02}{suffix}", blade + [0, 0, height], BLADE_TRIANGLES)


def thread_through_itself(folder):
    """A thread whose end is pulled down through edge 2 3 in the step to frame 4."""
    rest = np.array(
        [[-9, 0, 0], [-6, 0, 0], [-3, 0, 0], [3, 0, 0], [6, 2, 0], [6, 6, 1], [1, 3, 2]]
        + [[0.5, -3, 2]],
        dtype=np.float64,
    )
    frames = np.repeat(rest[None], 7, axis=0)
    frames[:, 6:, 2] -= np.array([0, 0.5, 1, 1.5, 2.5, 3.5, 4.5])[:, None]
    segments = np.stack([np.arange(7), np.arange(1, 8)], axis=1)
    np.savez(folder / "thread.npz", positions=frames, segments=segments)


def cloth_that_tears(folder):
    """A cloth above a ball tears in frame 3. Then vertex 85 of its flap is in the ball."""
    cloth, triangles = grid(8, z=1.3)
    flap = np.array([36, 37, 38, 39, 40])  # the middle row, up to the middle
    below = (cloth[triangles].mean(axis=1)[:, 1] < 0) & np.isin(triangles, flap).any(axis=1)
    torn = triangles.copy()
    for copy, vertex in enumerate(flap):
        torn[below] = np.where(torn[below] == vertex, len(cloth) + copy, torn[below])
    for frame in range(6):
        positions, elements = cloth + [0, 0, 0.01 * frame], triangles
        if frame >= 3:
            hanging = positions[flap]
            hanging[-1] = [0, 0, 0.9 - 0.1 * frame]
            positions, elements = np.concatenate([positions, hanging]), torn
        write(folder / f"cloth{frame:04}.ply", positions, elements)
    write(folder / "body.stl", *ball(12))


def falling_ball(folder):
    """Nothing is wrong: a ball falls towards a floor, and then stays above it."""
    for frame in range(6):
        positions, triangles = ball(8, centre=(0, 0, max(3 - frame, 1.1)))
        write(folder / f"ball_{frame}.stl", positions, triangles)
    write(folder / "floor.obj", *grid(2))


def inverted_tetrahedron(folder):
    """Two tetrahedra with a common face; tetrahedron 1 is pushed inside out in frames 2 and 3."""
    rest = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2], [2, 2, 2]], dtype=np.float64)
    tetrahedra = np.array([[0, 1, 2, 3], [1, 2, 3, 4]], dtype=np.uint32)
    volumes = [np.linalg.det(rest[t[1:]] - rest[t[0]]) for t in tetrahedra]
    assert min(volumes) > 0
    for frame in range(5):
        positions = rest.copy()
        if frame in (2, 3):
            positions[4] = [0.5, 0.5, 0.5]
        write(folder / f"organ.{frame}.vtu", positions, tetrahedra=tetrahedra)


def made(make, tmp_path, *arguments):
    folder = pathlib.Path(tmp_path) / make.__name__
    folder.mkdir()
    make(folder, *arguments)
    return folder
