"""Each program of Examples/Python runs."""

import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

EXAMPLES = pathlib.Path(os.environ["PALPATE_SOURCE"]) / "Examples" / "Python"


def run(program, *arguments, by=()):
    result = subprocess.run(
        [*by, sys.executable, "-B", EXAMPLES / program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def module_of(program):
    spec = importlib.util.spec_from_file_location(pathlib.Path(program).stem, EXAMPLES / program)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_hello():
    assert len((EXAMPLES / "hello.py").read_text().splitlines()) <= 22
    text = run("hello.py")
    assert "vertex 0 meets triangle 0 at time 0.125" in text
    assert "1 vertex-triangle, 1 edge-edge, by Continuous, trusted" in text


def test_needle(tmp_path):
    text = run("needle.py")
    assert text.startswith("2000 paths tested in ") and "picture" not in text
    possible = int(text.splitlines()[1].split()[0])
    assert 100 < possible < 1900
    clearances = [float(line.split()[-2]) for line in text.splitlines()[2:]]
    assert len(clearances) == 10 and clearances[-1] > 1
    assert clearances == sorted(clearances, reverse=True)
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    assert "picture: " in run("needle.py", tmp_path / "needle.png")
    assert (tmp_path / "needle.png").stat().st_size > 10_000


def test_cloth():
    text = run("cloth.py", "--rows", 17, "--substeps", 4)
    assert text.splitlines()[-1] == "0 pairs of triangles intersect"


def test_cloth_notices_intersections():
    cloth = module_of("cloth.py")
    simulation = cloth.Simulation(17, 4)
    assert simulation.intersections() == 0
    simulation.cloth.positions[:, 2] -= 40
    assert simulation.intersections() > 0


def test_cloth_is_drawn(tmp_path):
    pytest.importorskip("vtk", reason="VTK is not installed")
    if shutil.which("xvfb-run") is None:
        pytest.skip("xvfb-run is not installed")
    picture = tmp_path / "cloth.png"
    settings = "--rows", 9, "--substeps", 3
    assert f"picture: {picture}" in run("cloth.py", picture, *settings, by=["xvfb-run", "-a"])
    assert picture.stat().st_size > 10_000


def test_speed_accuracy(tmp_path):
    rows = [line.split() for line in run("speed_accuracy.py", "--frames", 4).splitlines()]
    missed = {(row[0], int(row[1])): float(row[-3]) for row in rows}
    assert missed["PROXIMITY", 1] > missed["PROXIMITY", 16] > 0
    assert missed["INTERSECTION", 1] > missed["INTERSECTION", 16]
    assert {missed["CONTINUOUS", 1], missed["CONTINUOUS", 4], missed["AUTO", 1]} == {0.0}
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    assert "pictures: " in run("speed_accuracy.py", "--frames", 2, tmp_path / "chart")
    assert all((tmp_path / f"chart.{end}").stat().st_size > 10_000 for end in ("png", "svg"))


def test_every_example_is_tested():
    here = pathlib.Path(__file__).read_text()
    assert all(f'run("{path.name}"' in here for path in EXAMPLES.glob("*.py"))
