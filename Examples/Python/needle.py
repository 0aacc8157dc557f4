"""Plans a needle's path: 2,000 straight paths to a target in an organ are tested and ranked.

A path must enter the organ once, and nothing else. The best one has the largest clearance from the
vessels and the rib, and is the shortest of equal ones. With matplotlib a picture is written to the
file that the command line names; without, the ranking is printed only. Lengths are in mm.

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
RIB = (-80, 10, 62), (80, 25, 58)
BEST = 10  # paths that are listed and drawn


@dataclass
class Scene:
    collisions: palpate.OctreeBasedCD
    organ: int
    vessels: int
    rib: int
    centre_lines: list[Floats]
    organ_positions: Floats
    organ_triangles: npt.NDArray[np.int64]


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
    for start in range(2, 19):
        direction = random.normal(size=3) * [0.5, 1, 1]
        direction *= 34 / np.linalg.norm(direction)
        bend = random.normal(size=3) * 6
        lines.append(trunk[start] + t * direction + t**2 * bend)
    return lines


def build(random: np.random.Generator) -> Scene:
    collisions = palpate.OctreeBasedCD()
    positions, triangles = organ_mesh()
    organ = collisions.add_triangle_mesh(positions, triangles)
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
    rib = collisions.add_analytical_geometry(palpate.Capsule(*RIB, 6))
    return Scene(collisions, organ, vessels, rib, lines, positions, triangles)


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


def ranked(entries: Floats, clearance: Floats) -> npt.NDArray[np.int64]:
    """By clearance to a tenth of a millimetre; of equal ones the shorter path comes first."""
    order: npt.NDArray[np.int64] = np.lexsort(
        (np.linalg.norm(entries - TARGET, axis=1), -np.round(clearance, 1))
    )
    return order


def draw(scene: Scene, entries: Floats, clearance: Floats, file: str) -> bool:
    """Writes a picture of the best paths and a map of all entries; False without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    best = ranked(entries, clearance)[:BEST]
    possible = clearance >= MARGIN
    figure = pyplot.figure(figsize=(12, 5.6))
    colours, scale = pyplot.get_cmap("viridis"), Normalize(MARGIN, clearance.max())

    axes = figure.add_axes((-0.02, -0.06, 0.5, 1.06), projection="3d", computed_zorder=False)
    axes.plot_trisurf(
        *scene.organ_positions.T,
        triangles=scene.organ_triangles,
        color="#d9a19a",
        alpha=0.13,
        shade=False,
        linewidth=0,
        zorder=1,
    )
    for line, width in zip(scene.centre_lines, [5] + [2.5] * len(scene.centre_lines)):
        axes.plot(*line.T, color="firebrick", linewidth=width, solid_capstyle="round", zorder=2)
    paths = np.stack([entries, np.broadcast_to(TARGET, entries.shape)], axis=1)
    for chosen, width, alpha in ((np.flatnonzero(possible), 0.5, 0.15), (best, 2.5, 1.0)):
        axes.add_collection3d(
            Line3DCollection(
                paths[chosen],
                colors=colours(scale(clearance[chosen])),
                linewidths=width,
                alpha=alpha,
                zorder=4,
            )
        )
    axes.plot(*np.transpose(RIB), color="tan", linewidth=9, solid_capstyle="round", zorder=3)
    axes.scatter(*TARGET, color="black", s=45, zorder=5)
    axes.text(*(TARGET - [0, 0, 9]), "target", ha="center", va="top", zorder=6)
    axes.text(*(np.array(RIB[0]) + [0, 0, 9]), "rib", ha="left", zorder=6)
    vessel = scene.centre_lines[0][0] + [-2, 0, 0]
    axes.text(*vessel, "vessels", ha="right", va="center", color="firebrick", zorder=6)
    axes.view_init(elev=14, azim=-62)
    axes.set_box_aspect(np.ptp([[-75, -60, -45], [75, 60, 95]], axis=0), zoom=1.35)
    axes.set(xlim=(-75, 75), ylim=(-60, 60), zlim=(-45, 95))
    axes.set_axis_off()
    title = f"The {BEST} best of {len(entries)} paths to the target"
    figure.text(0.02, 0.93, title, fontsize=13, weight="bold")

    plan = figure.add_axes((0.53, 0.1, 0.38, 0.78))
    plan.scatter(*entries[~possible, :2].T, color="#d8d8d8", s=7)
    dots = plan.scatter(
        *entries[possible, :2].T, c=clearance[possible], s=16, cmap=colours, norm=scale
    )
    plan.scatter(*entries[best, :2].T, facecolors="none", edgecolors="black", s=60)
    plan.annotate(
        "best",
        entries[best[0], :2],
        xytext=(-45, -4),
        textcoords="offset points",
        weight="bold",
        arrowprops={"arrowstyle": "-"},
    )
    plan.set_aspect("equal")
    plan.set(xlabel="x (mm)", ylabel="y (mm)", xlim=(-115, 85))
    for side in ("top", "right"):
        plan.spines[side].set_visible(False)
    figure.colorbar(dots, ax=plan, label="clearance of the path (mm)", shrink=0.8)
    title = f"Entries from above: {possible.sum()} keep {MARGIN:g} mm clear, the grey ones do not"
    figure.text(0.53, 0.93, title, fontsize=11)
    figure.savefig(file, dpi=110)
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
    for rank, number in enumerate(ranked(entries, clearance)[:BEST], start=1):
        x, y, z = entries[number]
        length = np.linalg.norm(entries[number] - TARGET)
        print(
            f"{rank:2}. entry ({x:5.1f}, {y:5.1f}, {z:5.1f}), length {length:5.1f} mm,"
            f" clearance {clearance[number]:4.1f} mm"
        )
    if len(sys.argv) > 1:
        drawn = draw(scene, entries, clearance, sys.argv[1])
        print(f"picture: {sys.argv[1]}" if drawn else "no picture: matplotlib is not installed")


if __name__ == "__main__":
    main()
