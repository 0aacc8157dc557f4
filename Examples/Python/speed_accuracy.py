"""Draws speed against accuracy of the methods, from a live run: needle tips dive through a sheet.

Every method follows the same motion, with one detection or several in a frame of 1/60 s. The sheet
is flat, so that arithmetic says which needles touch it within a frame. A method misses such a
needle if none of the frame's detections has a contact of it. Lengths are in mm, times in s.

    python3 speed_accuracy.py [--frames 40] [PICTURE]     # writes PICTURE.png and PICTURE.svg
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import palpate

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

FRAME = 1 / 60
THICKNESS = 0.1
SIZE, SQUARES = 40.0, 20  # the sheet's edge, and the squares along it
NEEDLES, LENGTH, RADIUS, SIDES = 60, 1.0, 0.2, 6
SPEEDS = 100.0, 1200.0  # mm/s; the fastest needle moves twenty times its length in a frame
HEIGHT = 20.0  # needles turn at this distance from the sheet


@dataclass
class Series:
    method: palpate.Method
    steps: tuple[int, ...]  # of a frame
    colour: str
    labels: tuple[int, int]  # where the numbers of steps stand, in points
    name: tuple[int, int]


SERIES = [
    Series(palpate.Method.INTERSECTION, (1, 2, 4, 8, 16, 32), "#3E9BD0", (-9, -8), (16, -50)),
    Series(palpate.Method.PROXIMITY, (1, 2, 4, 8, 16, 32), "#009E73", (9, 8), (26, 16)),
    Series(palpate.Method.CONTINUOUS, (1, 2, 4), "#D55E00", (0, 11), (-20, 28)),
    Series(palpate.Method.AUTO, (1,), "#333333", (0, 0), (22, 12)),
]


@dataclass
class Measured:
    steps: int
    milliseconds: float  # median of the frames
    missed: float  # percent of the needles that touch the sheet within a frame


class Motion:
    """Needles that move up and down along their axes, each at a speed and a tilt of its own."""

    def __init__(self, random: np.random.Generator) -> None:
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        circle = RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        ring = np.column_stack([circle, np.full(SIDES, LENGTH)])
        shape = np.concatenate([[[0, 0, 0]], ring])
        corners = 1 + np.arange(SIDES)
        cone = np.stack([0 * corners, corners, np.roll(corners, -1)], axis=1)
        first = len(shape) * np.arange(NEEDLES)
        self.triangles = (first[:, None, None] + cone).reshape(-1, 3)
        tilt, turn = random.uniform(0, 0.5, NEEDLES), random.uniform(0, 2 * np.pi, NEEDLES)
        self.axes = np.stack(
            [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=1
        )
        side = np.cross(self.axes, [0, 1, 0])
        side /= np.linalg.norm(side, axis=1)[:, None]
        frames = np.stack([side, np.cross(self.axes, side), self.axes], axis=1)
        self.shapes = np.einsum("vk,nkd->nvd", shape, frames)
        self.places = random.uniform(-0.3 * SIZE, 0.3 * SIZE, (NEEDLES, 3)) * [1, 1, 0]
        self.speeds = random.uniform(*SPEEDS, NEEDLES)
        self.phases = random.uniform(0, 4 * HEIGHT, NEEDLES)

    def positions(self, seconds: float) -> Floats:
        way = np.abs((self.phases + self.speeds * seconds) % (4 * HEIGHT) - 2 * HEIGHT) - HEIGHT
        tips = self.places + way[:, None] * self.axes
        result: Floats = (tips[:, None, :] + self.shapes).reshape(-1, 3)
        return result

    def touching(self, start: Floats, end: Floats) -> Bools:
        """Which needles touch the plane of the sheet in a linear step."""
        heights = np.stack([start, end])[:, :, 2].reshape(2, NEEDLES, -1)
        result: Bools = (heights.min(axis=(0, 2)) <= 0) & (heights.max(axis=(0, 2)) >= 0)
        return result


def sheet() -> tuple[Floats, npt.NDArray[np.uint32]]:
    line = np.linspace(-SIZE / 2, SIZE / 2, SQUARES + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    g = np.arange(x.size).reshape(x.shape)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=-1).reshape(-1, 4)
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return positions, palpate.triangles_of_quads(quads)


def needles_in(data: palpate.CollisionData) -> npt.NDArray[np.int64]:
    """The needles, the first geometry of the pair, of which there is a contact."""
    vertices = np.concatenate([data.vertex_triangle["vertex"], data.edge_edge["edge_a"][:, 0]])
    triangles = np.concatenate(
        [data.triangle_vertex["triangle"], data.intersecting_triangles["a"]]
    )
    found: npt.NDArray[np.int64] = np.union1d(vertices // (SIDES + 1), triangles // SIDES)
    return found.astype(np.int64)


def measure(motion: Motion, method: palpate.Method, steps: int, frames: int) -> Measured:
    collisions = palpate.OctreeBasedCD(threads=1)
    a = collisions.add_triangle_mesh(motion.positions(0), motion.triangles)
    b = collisions.add_triangle_mesh(*sheet())
    collisions.add_collision_pair(a, b, method=method, thickness=THICKNESS, contacts="all")
    collisions.advance()
    times, touches, missed = [], 0, 0
    for frame in range(frames):
        ends = [FRAME * (frame + step / steps) for step in range(steps + 1)]
        positions = [motion.positions(end) for end in ends]
        found = np.zeros(NEEDLES, dtype=bool)
        start = time.perf_counter()
        answers = []
        for now in positions[1:]:
            collisions.set_positions(a, now)
            collisions.detect_collision()
            answers.append(collisions.collision_data(a, b))
            collisions.advance()
        times.append(1000 * (time.perf_counter() - start))
        for answer in answers:
            found[needles_in(answer)] = True
        touching = motion.touching(positions[0], positions[-1])
        touches += int(touching.sum())
        missed += int((touching & ~found).sum())
    return Measured(steps, float(np.median(times)), 100 * missed / touches)


def draw(results: list[tuple[Series, list[Measured]]], file: str) -> bool:
    """Writes FILE.png and FILE.svg; False without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.ticker import FuncFormatter

    figure, axes = pyplot.subplots(figsize=(8, 4.8))
    for series, rows in results:
        x, y = [row.milliseconds for row in rows], [row.missed for row in rows]
        axes.plot(x, y, "o-", color=series.colour, markersize=6, clip_on=False, zorder=3)
        (dx, dy), (name_dx, name_dy) = series.labels, series.name
        for row in rows if len(rows) > 1 else []:
            axes.annotate(
                str(row.steps),
                (row.milliseconds, row.missed),
                xytext=(dx, dy),
                textcoords="offset points",
                ha="center",
                va="center",
                fontsize=9,
                color=series.colour,
            )
        axes.annotate(
            series.method.name.capitalize(),
            (x[0], y[0]),
            xytext=(name_dx, name_dy),
            textcoords="offset points",
            ha="center",
            va="center",
            weight="bold",
            color=series.colour,
        )
    axes.set_xscale("log")
    axes.set_ylim(0, 100)
    axes.set_xlabel("milliseconds a frame, one thread")
    axes.set_ylabel("missed contacts (%)")
    axes.grid(True, color="#eeeeee")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_title("The continuous methods miss no contact", loc="left", weight="bold", pad=24)
    axes.text(
        0,
        1.03,
        f"{NEEDLES} needle tips at {SPEEDS[0]:g} to {SPEEDS[1]:g} mm/s meet a sheet."
        " Numbers: detections in a frame of 1/60 s.",
        transform=axes.transAxes,
        fontsize=9,
        color="#555555",
    )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.tight_layout()
    for ending in ("png", "svg"):
        figure.savefig(f"{file}.{ending}", dpi=130)
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description="Draws speed against accuracy of the methods.")
    parser.add_argument("picture", nargs="?", help="the name of the picture, without an ending")
    parser.add_argument("--frames", type=int, default=40, help="frames that are measured")
    options = parser.parse_args()
    results = []
    for series in SERIES:
        rows = []
        for steps in series.steps:
            motion = Motion(np.random.default_rng(3))
            rows.append(measure(motion, series.method, steps, options.frames))
            print(
                f"{series.method.name:12} {steps:2} steps:"
                f" {rows[-1].milliseconds:6.2f} ms a frame, {rows[-1].missed:5.1f} % missed"
            )
        results.append((series, rows))
    if options.picture:
        drawn = draw(results, options.picture)
        print(f"pictures: {options.picture}.png, .svg" if drawn else "no picture: no matplotlib")


if __name__ == "__main__":
    main()
