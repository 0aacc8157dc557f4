"""Drops a cloth onto a liver: position-based dynamics in NumPy, contacts by palpate.

The cloth meets the liver and itself. It ends at rest, and nothing intersects; the program checks
that exactly and fails otherwise. With VTK a picture is written to the file that the command line
names. Lengths are in mm, times in s.

    xvfb-run -a python3 cloth.py [--rows 37] [--substeps 5] [cloth.png]
"""

import argparse
import os
import pathlib
import sys
import time
from typing import Any

import numpy as np
import numpy.typing as npt

import palpate

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

ORGAN = pathlib.Path(__file__).resolve().parents[2] / "Data" / "Organs" / "Liver.obj"
SIZE = 150.0  # the cloth's edge
FRAME = 1 / 60
MOST_FRAMES = 480
GRAVITY = np.array([0, 0, -9810.0])
DAMPING = 3.0  # 1/s
FRICTION = 0.4
THICKNESS = 1.0  # features this near are contacts; the solver keeps half of it clear
REST_SPEED = 8.0  # mm/s: a cloth whose fastest vertex is slower is at rest


def read_organ() -> tuple[Floats, Indices]:
    lines = [line.split() for line in ORGAN.read_text().splitlines()]
    positions = np.array([line[1:] for line in lines if line[0] == "v"], dtype=np.float64)
    triangles = np.array([line[1:] for line in lines if line[0] == "f"], dtype=np.int64)
    return positions - positions.mean(axis=0), triangles - 1


class Cloth:
    """A square sheet of rows x rows vertices, with batches of edges that share no vertex."""

    def __init__(self, rows: int, height: float) -> None:
        self.grid = np.arange(rows * rows).reshape(rows, rows)
        line = np.linspace(-SIZE / 2, SIZE / 2, rows)
        x, y = np.meshgrid(line, line, indexing="ij")
        turn = np.radians(20)
        x, y = np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y
        self.positions: Floats = np.stack([x, y, 0 * x + height], axis=-1).reshape(-1, 3)
        self.velocities = np.zeros_like(self.positions)
        quads = np.stack(
            [self.grid[:-1, :-1], self.grid[1:, :-1], self.grid[1:, 1:], self.grid[:-1, 1:]],
            axis=-1,
        ).reshape(-1, 4)
        self.triangles = palpate.triangles_of_quads(quads)
        self.batches = []  # (first vertices, second vertices, rest lengths, compliance)
        g = self.grid
        for first, second, compliance in [
            (g[:, :-1], g[:, 1:], 0.0),
            (g.T[:, :-1], g.T[:, 1:], 0.0),
            (g[:-1, :-1].T, g[1:, 1:].T, 2e-8),  # shear
            (g[:-1, 1:].T, g[1:, :-1].T, 2e-8),
            (g[:, :-2], g[:, 2:], 2e-6),  # bending
            (g.T[:, :-2], g.T[:, 2:], 2e-6),
        ]:
            width = 2 if compliance == 2e-6 else 1
            colour = np.arange(first.shape[1]) // width % 2
            for chosen in (colour == 0, colour == 1):
                a, b = first[:, chosen].ravel(), second[:, chosen].ravel()
                rest = np.linalg.norm(self.positions[a] - self.positions[b], axis=1)
                self.batches.append((a, b, rest, compliance))

    def stretch(self, seconds: float) -> None:
        """One pass over all edges: each gets its rest length, as far as its compliance allows."""
        for a, b, rest, compliance in self.batches:
            edge = self.positions[a] - self.positions[b]
            length = np.sqrt(np.einsum("ij,ij->i", edge, edge))
            share = (length - rest) / (length * (2 + compliance / seconds**2))
            move = share[:, None] * edge
            self.positions[a] -= move
            self.positions[b] += move


def push_apart(positions: Floats, before: Floats, count: int, rows: Any) -> None:
    """Moves the first `count` vertices apart to half the thickness, with friction."""
    vertices, weights, normals = rows["vertices"], rows["weights"], rows["normal"]
    free = vertices < count
    mobility = (free * weights**2).sum(axis=1)
    gaps = np.einsum("rk,rkd,rd->r", weights, positions[vertices], normals) - rows["offset"]
    depth = np.where(mobility > 0, np.maximum(0, THICKNESS / 2 - gaps), 0)
    active = depth > 0
    vertices, weights, normals = vertices[active], weights[active], normals[active]
    depth, mobility, free = depth[active], mobility[active], free[active]
    slide = np.einsum("rk,rkd->rd", weights, positions[vertices] - before[vertices])
    slide -= np.einsum("rd,rd->r", slide, normals)[:, None] * normals
    length = np.linalg.norm(slide, axis=1)
    share = np.minimum(1, FRICTION * depth / np.maximum(length, 1e-12))
    push = (depth[:, None] * normals - share[:, None] * slide) / mobility[:, None]
    moves = (weights * free)[:, :, None] * push[:, None, :]
    shared = np.maximum(1, np.bincount(vertices[free], minlength=count))
    for axis in range(3):
        sums = np.bincount(vertices[free], moves[free][:, axis], minlength=count)
        positions[:count, axis] += sums / shared


class Simulation:
    def __init__(self, rows: int, substeps: int) -> None:
        self.substeps = substeps
        self.organ, self.organ_triangles = read_organ()
        self.cloth = Cloth(rows, self.organ[:, 2].max() + 10)
        self.count = len(self.cloth.positions)
        self.collisions = palpate.OctreeBasedCD()
        self.a = self.collisions.add_triangle_mesh(self.cloth.positions, self.cloth.triangles)
        self.b = self.collisions.add_triangle_mesh(self.organ, self.organ_triangles)
        self.collisions.add_collision_pair(
            self.a, self.b, method="auto", thickness=THICKNESS
        )
        self.collisions.add_collision_pair(
            self.a,
            self.a,
            method="auto",
            thickness=THICKNESS,
            rest_distance=3 * THICKNESS,
        )
        self.guard = palpate.StepGuard(self.collisions)
        self.collisions.advance()

    def step(self) -> None:
        """One substep: predict, correct lengths, push contacts apart, hold back what is left."""
        cloth, seconds = self.cloth, FRAME / self.substeps
        before = cloth.positions.copy()
        cloth.velocities += seconds * GRAVITY
        cloth.velocities *= np.exp(-DAMPING * seconds)
        cloth.positions += seconds * cloth.velocities
        cloth.stretch(seconds)

        self.collisions.set_positions(self.a, cloth.positions)
        self.collisions.detect_collision()
        start, end = (np.concatenate([p, self.organ]) for p in (before, cloth.positions))
        sides = [
            palpate.SolverVertices(cloth.positions, before),
            palpate.SolverVertices(self.organ, self.organ, self.count),
        ]
        rows = np.concatenate(
            [
                self.collisions.collision_data(self.a, other).constraint_rows(sides[0], side)
                for other, side in ((self.a, sides[0]), (self.b, sides[1]))
            ]
        )
        for _ in range(3):
            push_apart(end, start, self.count, rows)

        self.collisions.set_positions(self.a, end[: self.count])
        self.guard.hold()
        cloth.positions = self.collisions.positions(self.a)
        cloth.velocities = (cloth.positions - before) / seconds
        self.collisions.advance()

    def frame(self) -> float:
        """A frame; returns how fast the fastest vertex was over it."""
        start = self.cloth.positions.copy()
        for _ in range(self.substeps):
            self.step()
        return float(np.linalg.norm(self.cloth.positions - start, axis=1).max() / FRAME)

    def intersections(self) -> int:
        """How many pairs of triangles intersect now, decided exactly."""
        check = palpate.OctreeBasedCD()
        a = check.add_triangle_mesh(self.cloth.positions, self.cloth.triangles)
        b = check.add_triangle_mesh(self.organ, self.organ_triangles)
        for other in (a, b):
            check.add_collision_pair(a, other, method=palpate.Method.INTERSECTION)
        check.detect_collision()
        return sum(len(check.collision_data(a, c).intersecting_triangles) for c in (a, b))

    def nearest(self) -> float:
        """The least distance of a cloth's vertex from the organ."""
        near = self.collisions.queries().closest_points(self.b, self.cloth.positions)
        return float(near["distance"].min())


def poly_data(positions: Floats, triangles: npt.NDArray[Any]) -> Any:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    data, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(positions, deep=True))
    corners = np.hstack([np.full((len(triangles), 1), 3), triangles]).astype(np.int64)
    cells.SetCells(len(triangles), numpy_to_vtkIdTypeArray(corners.ravel(), deep=True))
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def shown(data: Any, colour: tuple[float, float, float]) -> Any:
    import vtk

    normals = vtk.vtkPolyDataNormals()
    normals.SetInputData(data)
    normals.SplittingOff()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(normals.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*colour)
    actor.GetProperty().SetAmbient(0.12)
    actor.GetProperty().SetSpecular(0.15)
    return actor


def draw(simulation: Simulation, stages: list[tuple[str, Floats]], file: str) -> None:
    """Writes a picture of the stages side by side. The cloth has squares, which show its folds."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(520 * len(stages), 410)
    window.SetMultiSamples(8)
    rows = len(simulation.cloth.grid)
    i, j = np.divmod(np.arange((rows - 1) ** 2), rows - 1)
    dark = np.repeat((i // 4 + j // 4) % 2, 2)
    colours = np.where(dark[:, None], (38, 94, 150), (232, 238, 244)).astype(np.uint8)
    for number, (title, positions) in enumerate(stages):
        renderer = vtk.vtkRenderer()
        renderer.SetViewport(number / len(stages), 0, (number + 1) / len(stages), 1)
        renderer.SetBackground(1, 1, 1)
        renderer.AddActor(
            shown(poly_data(simulation.organ, simulation.organ_triangles), (0.62, 0.22, 0.18))
        )
        cloth = poly_data(positions, simulation.cloth.triangles)
        scalars = numpy_to_vtk(colours, deep=True)
        cloth.GetCellData().SetScalars(scalars)
        renderer.AddActor(shown(cloth, (1, 1, 1)))
        text = vtk.vtkTextActor()
        text.SetInput(title)
        text.GetTextProperty().SetFontSize(22)
        text.GetTextProperty().SetColor(0.15, 0.15, 0.15)
        text.SetPosition(20, 14)
        renderer.AddActor2D(text)
        camera = renderer.GetActiveCamera()
        camera.SetFocalPoint(18, 0, 4)
        camera.SetPosition(150, -400, 260)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(24)
        renderer.ResetCameraClippingRange()
        for place, strength in ((200, -250, 500), 0.75), ((-400, -300, 100), 0.45):
            light = vtk.vtkLight()
            light.SetPosition(*place)
            light.SetIntensity(strength)
            renderer.AddLight(light)
        window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(file)
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


def picture(simulation: Simulation, stages: list[tuple[str, Floats]], file: str) -> str:
    """Draws where it is possible. VTK would end the program without a display."""
    try:
        import vtk  # noqa: F401
    except ImportError:
        return "no picture: VTK is not installed"
    if not os.environ.get("DISPLAY"):
        return "no picture: VTK needs a display; run the program by xvfb-run -a"
    draw(simulation, stages, file)
    return f"picture: {file}"


def main() -> int:
    parser = argparse.ArgumentParser(description="Drops a cloth onto a liver.")
    parser.add_argument("picture", nargs="?", help="a PNG file to write")
    parser.add_argument("--rows", type=int, default=37, help="vertices along an edge of the cloth")
    parser.add_argument("--substeps", type=int, default=5, help="steps in a frame of 1/60 s")
    options = parser.parse_args()

    simulation = Simulation(options.rows, options.substeps)
    stages = [("0 s", simulation.cloth.positions.copy())]
    start, frames, speed = time.perf_counter(), 0, np.inf
    while speed > REST_SPEED and frames < MOST_FRAMES:
        speed = simulation.frame()
        frames += 1
        if frames == 8:
            stages.append((f"{frames * FRAME:.2f} s", simulation.cloth.positions.copy()))
    rest = ", at rest" if speed <= REST_SPEED else ""
    stages.append((f"{frames * FRAME:.2f} s{rest}", simulation.cloth.positions.copy()))
    milliseconds = 1000 * (time.perf_counter() - start) / frames
    print(f"{frames} frames of {options.substeps} steps, {milliseconds:.0f} ms a frame")
    print(f"fastest vertex: {speed:.1f} mm/s; least distance: {simulation.nearest():.2f} mm")
    intersections = simulation.intersections()
    print(f"{intersections} pairs of triangles intersect")
    if options.picture:
        print(picture(simulation, stages, options.picture))
    if intersections > 0 or speed > REST_SPEED or simulation.nearest() > THICKNESS:
        print("The cloth does not rest on the organ without intersections.", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
