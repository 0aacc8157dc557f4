"""Plans a needle's path: 2,000 straight paths to a target in an organ are tested and ranked.

A path must enter the organ once, and nothing else. The best one has the largest clearance from the
vessels and the rib. With matplotlib a picture is written to the file that the command line names;
without, the ranking is printed only. Lengths are in mm.

    python3 needle.py [needle.png]
"""

import sys
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import palpate

Floats = npt.NDArray[np.float64]

PATHS = 2000
NEEDLE_RADIUS = 0.6
MARGIN = 1.0  # the least clearance that is accepted
TARGET = np.array([12.0, -8.0, -10.0])


@dataclass
class Scene:
    collisions: palpate.OctreeBasedCD
    organ: int
    vessels: int
    rib: int
    centre_lines: list[Floats]


def organ_mesh(rows: int = 24) -> tuple[Floats, npt.NDArray[np.int64]]:
    """An ellipsoid with dents, closed and wound outward."""
    columns = 2 * rows
    polar = np.pi * np.arange(1, rows) / rows
    azimuth = 2 * np.pi * np.arange(columns) / columns
    sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None]
    ring = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), cosine * np.ones(columns)], axis=-1
    ).reshape(-1, 3)
    unit = np.concatenate([[[0, 0, 1]], ring, [[0, 0, -1]]])
    dents = 1 + 0.06 * np.sin(5 * unit[:, 0]) * np.cos(4 * unit[:, 1])
    first, last = np.arange(columns), len(unit) - 1
    after = np.roll(first, -1)
    triangles = [np.stack([0 * first, 1 + first, 1 + after], axis=1)]
    for row in range(rows - 2):
        p, q = 1 + row * columns, 1 + (row + 1) * columns
        triangles.append(np.stack([p + first, q + first, q + after], axis=1))
        triangles.append(np.stack([p + first, q + after, p + after], axis=1))
    p = last - columns
    triangles.append(np.stack([p + first, 0 * first + last, p + after], axis=1))
    return unit * dents[:, None] * [70, 55, 40], np.concatenate(triangles)


def vessel_tree(random: np.random.Generator) -> list[Floats]:
    """Centre lines that branch from a trunk."""
    t = np.linspace(0, 1, 20)[:, None]
    trunk = np.hstack([-50 + 90 * t, 10 * np.sin(4 * t), -4 + 6 * t])
    lines = [trunk]
    for start in range(3, 18, 3):
        direction = random.normal(size=3) * [0.4, 1, 0.8]
        direction *= 30 / np.linalg.norm(direction)
        bend = random.normal(size=3) * 6
        lines.append(trunk[start] + t * direction + t**2 * bend)
    return lines


def build(random: np.random.Generator) -> Scene:
    collisions = palpate.OctreeBasedCD()
    organ = collisions.add_triangle_mesh(*organ_mesh())
    lines = vessel_tree(random)
    segments, radii, first = [], [], 0
    for number, line in enumerate(lines):
        ids = first + np.arange(len(line))
        segments.append(np.stack([ids[:-1], ids[1:]], axis=1))
        radii.append(np.linspace(3.0, 1.5, len(line)) if number == 0 else np.full(len(line), 1.2))
        first += len(line)
    vessels = collisions.add_line_mesh(
        np.concatenate(lines), np.concatenate(segments), np.concatenate(radii)
    )
    rib = collisions.add_analytical_geometry(palpate.Capsule((-80, 10, 62), (80, 25, 58), 6))
    return Scene(collisions, organ, vessels, rib, lines)


def entry_points(random: np.random.Generator) -> Floats:
    """Points on the skin, a part of a sphere above the organ."""
    z = random.uniform(0.55, 1, PATHS)
    azimuth = random.uniform(0, 2 * np.pi, PATHS)
    side = np.sqrt(1 - z**2)
    points: Floats = 95 * np.stack([side * np.cos(azimuth), side * np.sin(azimuth), z], axis=1)
    return points


def clearances(scene: Scene, entries: Floats) -> Floats:
    """The clearance of each path from vessels and rib; negative where it is not possible."""
    queries = scene.collisions.queries()
    bodies = [scene.organ, scene.vessels, scene.rib]
    result = np.full(len(entries), -1.0)
    for number, entry in enumerate(entries):
        inside, outside = queries.path([entry, TARGET], NEEDLE_RADIUS, bodies)
        if inside["body"].tolist() == [scene.organ] and len(outside) == 2:
            result[number] = outside["distance"].min()
    return result


def draw(scene: Scene, entries: Floats, clearance: Floats, file: str) -> bool:
    """Writes a picture; False without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot

    axes = pyplot.figure(figsize=(8, 7)).add_subplot(projection="3d")
    for line in scene.centre_lines:
        axes.plot(*line.T, color="firebrick", linewidth=2)
    axes.plot(*np.array([[-80, 10, 62], [80, 25, 58]]).T, color="tan", linewidth=6)
    possible = clearance >= MARGIN
    axes.scatter(*entries[~possible].T, color="lightgrey", s=3)
    dots = axes.scatter(*entries[possible].T, c=clearance[possible], s=8, cmap="viridis")
    pyplot.colorbar(dots, ax=axes, label="clearance of the path (mm)", shrink=0.7)
    best = entries[np.argmax(clearance)]
    axes.plot(*np.array([best, TARGET]).T, color="black", linewidth=2)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_zlabel("z (mm)")
    axes.set_title(f"{possible.sum()} of {len(entries)} paths keep {MARGIN} mm clear")
    pyplot.savefig(file, dpi=110)
    return True


def main() -> None:
    random = np.random.default_rng(7)
    scene = build(random)
    entries = entry_points(random)
    start = time.perf_counter()
    clearance = clearances(scene, entries)
    seconds = time.perf_counter() - start
    possible = int((clearance >= MARGIN).sum())
    print(f"{len(entries)} paths tested in {1000 * seconds:.0f} ms")
    print(f"{possible} keep at least {MARGIN} mm clear of vessels and rib; the best are:")
    for rank, number in enumerate(np.argsort(-clearance)[:5], start=1):
        x, y, z = entries[number]
        length = np.linalg.norm(entries[number] - TARGET)
        print(
            f"{rank}. entry ({x:5.1f}, {y:5.1f}, {z:5.1f}), length {length:5.1f} mm,"
            f" clearance {clearance[number]:4.1f} mm"
        )
    if len(sys.argv) > 1:
        drawn = draw(scene, entries, clearance, sys.argv[1])
        print(f"picture: {sys.argv[1]}" if drawn else "no picture: matplotlib is not installed")


if __name__ == "__main__":
    main()
