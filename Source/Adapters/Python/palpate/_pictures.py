"""Pictures of findings: the elements around them, in the frame where they are.

VTK draws them off screen, in a process of its own, because it ends a process that has no display.
Where that fails they are projections in SVG.
"""

import base64
import importlib
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from palpate._captures import element_of, step_of
from palpate._findings import Finding
from palpate._frames import Mesh, Reader
from palpate._results import FloatArray, IndexArray
from palpate._sequence import Sequence

SIZE = 420  # pixels
MOST_ELEMENTS = 1500  # of a body in a picture
COLOURS = ("#7fb3d5", "#f5b041")
FAULT = "#c0392b"


class Drawn(NamedTuple):
    """Polygons of one body: (n, 3) corners as indices; at_fault: (n,)."""

    positions: FloatArray
    polygons: IndexArray
    at_fault: npt.NDArray[np.bool_]


def drawn(sequence: Sequence, reader: Reader, finding: Finding) -> list[Drawn]:
    """The surroundings of a finding, at the time of impact if it has one."""
    meshes, now = step_of(sequence, reader, finding)
    time = 1.0 if math.isnan(finding.time) else finding.time
    for name, before in meshes.items():
        end = now[name].positions
        meshes[name] = before._replace(positions=(1 - time) * before.positions + time * end)
    faults: dict[str, list[int]] = {name: [] for name in meshes}
    for name, feature in (
        (finding.body_a, finding.element_a),
        (finding.body_b, finding.element_b),
    ):
        if feature:
            faults[name].append(element_of(meshes[name], feature))
    corners = [m.positions[m.elements[faults[name]]].reshape(-1, 3) for name, m in meshes.items()]
    around = np.concatenate(corners)
    centre = around.mean(axis=0)
    reach = 4 * float(np.linalg.norm(around - centre, axis=1).max()) or 1.0
    return [_near(mesh, faults[name], centre, reach) for name, mesh in meshes.items()]


def _near(mesh: Mesh, faults: list[int], centre: FloatArray, reach: float) -> Drawn:
    middles = mesh.positions[mesh.elements].mean(axis=1)
    distances = np.linalg.norm(middles - centre, axis=1)
    distances[faults] = 0
    order = np.argsort(distances, kind="stable")[:MOST_ELEMENTS]
    chosen = np.sort(order[distances[order] <= reach])
    at_fault = np.isin(chosen, faults)
    vertices, elements = np.unique(mesh.elements[chosen], return_inverse=True)
    elements = elements.reshape(len(chosen), -1)
    positions = mesh.positions[vertices]
    if mesh.element == "tetrahedron":
        faces = elements[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]].reshape(-1, 3)
        _, inverse, counts = np.unique(
            np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        at_fault = np.repeat(at_fault, 4)
        outer = (counts[inverse.ravel()] == 1) | at_fault
        return Drawn(positions, faces[outer], at_fault[outer])
    width = elements.shape[1]
    return Drawn(positions, elements[:, [0, min(1, width - 1), width - 1]], at_fault)


class View(NamedTuple):
    """Unit vectors of a picture, and the point in its middle."""

    right: FloatArray
    up: FloatArray
    towards: FloatArray  # the viewer
    centre: FloatArray


def view_of(parts: list[Drawn]) -> View:
    """From above the two widest directions, tilted."""
    points = np.concatenate([part.positions[part.polygons].reshape(-1, 3) for part in parts])
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2]
    up = 0.6 * axes[1] + 0.8 * axes[2]
    return View(axes[0], up, np.cross(axes[0], up), centre)


def svg_of(parts: list[Drawn]) -> str:
    """A projection, the furthest polygons first."""
    points = np.concatenate([part.positions[part.polygons].reshape(-1, 3) for part in parts])
    right, up, towards, centre = view_of(parts)
    flat = np.stack([(points - centre) @ right, -(points - centre) @ up], axis=1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = (SIZE - 20) / max(float((high - low).max()), 1e-300)
    shapes = []
    for part, colour in zip(parts, COLOURS, strict=False):
        corners = part.positions[part.polygons] - centre
        flat = np.stack([corners @ right, -(corners @ up)], axis=2)
        flat = (flat - low) * scale + 10
        for polygon, depth, fault in zip(
            flat, (corners @ towards).mean(axis=1), part.at_fault, strict=True
        ):
            path = " ".join(f"{x:.1f},{y:.1f}" for x, y in polygon)
            fill = FAULT if fault else colour
            shapes.append(
                (
                    float(depth),
                    f'<polygon points="{path}" fill="{fill}" fill-opacity="0.75" '
                    f'stroke="{FAULT if fault else "#34495e"}" '
                    f'stroke-width="{2.5 if fault else 0.6}" stroke-linejoin="round"/>',
                )
            )
    shapes.sort(key=lambda shape: shape[0])
    size = (high - low) * scale + 20
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.0f}" height="{size[1]:.0f}">'
        + "".join(markup for _, markup in shapes)
        + "</svg>"
    )


def pictures_of(scenes: list[list[Drawn]], vtk: bool) -> list[str]:
    """The markup of each scene. vtk: try it before SVG."""
    images = _images_by_vtk(scenes) if vtk and scenes else None
    if images is None:
        return [svg_of(scene) for scene in scenes]
    return [
        f'<img alt="" width="{SIZE}" src="data:image/png;base64,'
        f'{base64.b64encode(image).decode()}">'
        for image in images
    ]


def _images_by_vtk(scenes: list[list[Drawn]]) -> list[bytes] | None:
    with tempfile.TemporaryDirectory() as folder:
        arrays: dict[str, npt.NDArray[Any]] = {}
        for number, scene in enumerate(scenes):
            for body, part in enumerate(scene):
                for name, values in part._asdict().items():
                    arrays[f"{number}.{body}.{name}"] = values
            arrays[f"{number}.view"] = np.stack(view_of(scene))
        np.savez(Path(folder) / "scenes.npz", **arrays)
        command = [sys.executable, "-m", "palpate._pictures", folder]
        if "DISPLAY" not in os.environ and (screen := shutil.which("xvfb-run")):
            command = [screen, "-a", *command]
        try:
            subprocess.run(command, check=True, timeout=120, capture_output=True)
            return [(Path(folder) / f"{n}.png").read_bytes() for n in range(len(scenes))]
        except (OSError, subprocess.SubprocessError):
            return None


def _draw_by_vtk(folder: Path) -> None:
    """Draws the scenes of scenes.npz to 0.png, 1.png and so on."""
    vtk: Any = importlib.import_module("vtkmodules.all")
    support: Any = importlib.import_module("vtkmodules.util.numpy_support")
    with np.load(folder / "scenes.npz") as arrays:
        count = len({name.split(".")[0] for name in arrays.files})
        for number in range(count):
            renderer = vtk.vtkRenderer()
            renderer.SetBackground(1, 1, 1)
            for body, colour in enumerate(COLOURS):
                key = f"{number}.{body}."
                if f"{key}positions" not in arrays.files:
                    continue
                positions, polygons = arrays[f"{key}positions"], arrays[f"{key}polygons"]
                at_fault = arrays[f"{key}at_fault"]
                for fault in (False, True):
                    actor = _actor(vtk, support, positions, polygons[at_fault == fault])
                    hexadecimal = (FAULT if fault else colour)[1:]
                    rgb = (int(hexadecimal[i : i + 2], 16) / 255 for i in (0, 2, 4))
                    actor.GetProperty().SetColor(*rgb)
                    actor.GetProperty().SetOpacity(1 if fault else 0.7)
                    renderer.AddActor(actor)
            window = vtk.vtkRenderWindow()
            window.SetOffScreenRendering(1)
            window.SetSize(2 * SIZE, 2 * SIZE)
            window.AddRenderer(renderer)
            view = View(*arrays[f"{number}.view"])
            camera = renderer.GetActiveCamera()
            camera.SetFocalPoint(view.centre)
            camera.SetPosition(view.centre + view.towards)
            camera.SetViewUp(view.up)
            renderer.ResetCamera()
            camera.Zoom(1.4)
            window.Render()
            image = vtk.vtkWindowToImageFilter()
            image.SetInput(window)
            writer = vtk.vtkPNGWriter()
            writer.SetFileName(str(folder / f"{number}.png"))
            writer.SetInputConnection(image.GetOutputPort())
            writer.Write()


def _actor(vtk: Any, support: Any, positions: FloatArray, polygons: IndexArray) -> Any:
    points = vtk.vtkPoints()
    points.SetData(support.numpy_to_vtk(positions, deep=True))
    cells = vtk.vtkCellArray()
    for polygon in polygons.tolist():
        corners = list(dict.fromkeys(polygon))
        if len(corners) == 3:
            cells.InsertNextCell(3, corners)
    lines = vtk.vtkCellArray()
    for polygon in polygons.tolist():
        corners = list(dict.fromkeys(polygon))
        if len(corners) == 2:
            lines.InsertNextCell(2, corners)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    data.SetLines(lines)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().EdgeVisibilityOn()
    actor.GetProperty().SetLineWidth(3)
    return actor


if __name__ == "__main__":
    _draw_by_vtk(Path(sys.argv[1]))
