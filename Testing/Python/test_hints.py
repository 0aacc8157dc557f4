"""The type hints hold: mypy --strict on the package and on a program, and stubtest."""

import os
import pathlib
import subprocess
import sys

import palpate

PACKAGE = pathlib.Path(palpate.__file__).parent

PROGRAM = """
import numpy as np
import numpy.typing as npt

import palpate


def contacts(points: npt.NDArray[np.float64]) -> palpate.Stencils:
    collisions = palpate.OctreeBasedCD(engine="octree", threads=2)
    a = collisions.add_triangle_mesh(points, [[0, 1, 2]])
    b: int = collisions.add_analytical_geometry(palpate.Sphere((0, 0, 0), radius=2))
    settings = palpate.PairSettings(method="proximity", thickness=0.1)
    collisions.add_collision_pair(a, b, settings, contacts=palpate.Contacts.ALL)
    collisions.set_transform(b, palpate.Pose(translation=(1, 0, 0)))
    collisions.set_transform(b, np.eye(3), [1, 0, 0])
    collisions.set_contact_predicate(a, b, lambda features: features.a[0] != 3)
    collisions.detect_collision()
    data = collisions.collision_data(a, b)
    snapshot = collisions.latest_snapshot()
    if snapshot is not None:
        positions: npt.NDArray[np.float64] = snapshot.positions(a)
        print(positions.shape, snapshot.queries().closest_points(a, positions)["distance"].min())
    trusted: bool = data.validity.trusted
    print(trusted, data.vertex_triangle["normal"], data.validity.method.name)
    try:
        palpate.DistanceField.build(points, [[0, 1, 2]], error_bound=0.1, band=1)
    except palpate.Error as error:
        code: palpate.ErrorCode = error.code
        print(code, error.geometry)
    return data.stencils()
"""

WRONG = """
import palpate
collisions = palpate.OctreeBasedCD(engine="octre")
a = collisions.add_triangle_mesh([[0, 0, 0]], [[0, 0, 0]])
collisions.add_collision_pair(a, "b", thickness="wide", method="fast")
collisions.set_transform(a, palpate.Sphere())
collisions.no_such_call()
"""

# What stubtest finds and what is no fault, as regular expressions of names.
NO_FAULTS = r"""
# these modules have their hints in their code, which mypy checks
palpate\._(enums|errors|meshes|results|settings|shapes)\..*
palpate\._(bodies|captures|exact|findings|frames|npz|pictures|progress|replay|report|sequence)\..*
palpate\.(check|cohort)\..*
# mypy does not see that keyword-only fields are no positional patterns
palpate\.(_\w+\.)?\w+\.__match_args__
# its defaults are arrays, which stubtest cannot compare
palpate\.MeshArrays\.__new__
# pybind11 has a metaclass of its own, and every class has an __init__, which may raise TypeError
palpate\.(_palpate\.)?[A-Z]\w+
palpate\.(_palpate\.)?[A-Z]\w+\.__init__
"""


def run(*arguments, cwd):
    folder = str(PACKAGE.parent)
    environment = {**os.environ, "PYTHONPATH": folder, "MYPYPATH": folder}
    return subprocess.run(
        [sys.executable, "-m", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=cwd,
        env=environment,
    )


def test_a_program_and_the_package_pass_mypy(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    for what in (["program.py"], ["-p", "palpate"]):
        checked = run("mypy", "--strict", *what, cwd=tmp_path)
        assert checked.returncode == 0, checked.stdout + checked.stderr
    examples = pathlib.Path(os.environ["PALPATE_SOURCE"]) / "Examples" / "Python"
    programs = sorted(examples.glob("*.py"))
    checked = run("mypy", "--strict", "--ignore-missing-imports", *programs, cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_mypy_finds_mistakes(tmp_path):
    (tmp_path / "wrong.py").write_text(WRONG)
    checked = run("mypy", "--strict", "wrong.py", cwd=tmp_path)
    lines = {line.split(":")[1] for line in checked.stdout.splitlines() if ": error:" in line}
    assert lines == {"3", "5", "6", "7"}, checked.stdout


def test_the_stubs_are_those_of_the_module(tmp_path):
    (tmp_path / "allowed").write_text(NO_FAULTS)
    checked = run("mypy.stubtest", "palpate", "--allowlist", "allowed", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr
