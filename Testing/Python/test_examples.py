"""Each program of Examples/Python runs."""

import os
import pathlib
import subprocess
import sys

import pytest

EXAMPLES = pathlib.Path(os.environ["PALPATE_SOURCE"]) / "Examples" / "Python"


def run(program, *arguments):
    result = subprocess.run(
        [sys.executable, "-B", EXAMPLES / program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


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
    clearances = [float(line.split()[-2]) for line in text.splitlines()[2:7]]
    assert clearances == sorted(clearances, reverse=True) and clearances[-1] > 1
    pytest.importorskip("matplotlib")
    assert "picture: " in run("needle.py", tmp_path / "needle.png")
    assert (tmp_path / "needle.png").stat().st_size > 10_000


def test_every_example_is_tested():
    here = pathlib.Path(__file__).read_text()
    assert all(f'run("{path.name}"' in here for path in EXAMPLES.glob("*.py"))
