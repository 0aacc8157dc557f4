"""Tasks on Dask: the answers of a serial run, whatever happens to workers."""

import csv
import importlib
import importlib.util
import os
import pathlib
import signal
import subprocess
import sys
import time
import types

import numpy as np
import pytest

import palpate
import sequences
from palpate import cohort
from scenes import Balls

distributed = pytest.importorskip("distributed", reason="Dask distributed is not installed")

SINGLE = {"env": {**os.environ, "OMP_NUM_THREADS": "1"}, "capture_output": True, "text": True}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    options = {"threads_per_worker": 1, "dashboard_address": None}
    options["local_directory"] = tmp_path_factory.mktemp("workers")
    with distributed.LocalCluster(n_workers=2, **options) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """Frames of balls that overlap more and more."""
    folder = tmp_path_factory.mktemp("captures")
    scene, paths = Balls(), []
    for number in range(9):
        scene.step(20 * number)
        scene.collisions.set_positions(scene.b, scene.positions + [2.0 - 0.01 * number, 0, 0])
        scene.collisions.detect_collision()
        paths.append(str(folder / f"frame{number}.txt"))
        palpate.capture(scene.collisions, paths[-1])
    return paths


def depth(shift, rows, log):
    """A task of a sweep: how deep two balls overlap, and by which process it was found."""
    with open(log, "a") as file:
        file.write(f"{shift} {os.getpid()}\n")
    time.sleep(0.1)
    scene = Balls(rows)
    cohort.watch(scene.collisions)
    data = scene.step(shift)
    if shift == 5:
        raise ValueError("no five")
    return {"nearest": data.vertex_triangle["distance"].min(), "contacts": len(data.edge_edge)}


def table(outcomes, path):
    cohort.write_table(outcomes, path)
    return pathlib.Path(path).read_bytes()


def test_answers_are_those_of_a_serial_run(cluster, captures, tmp_path):
    tasks = [{"path": path} for path in captures]
    counts = []
    serial = list(cohort.run(cohort.replay, tasks, workers=0))
    parallel = list(
        cohort.run(
            cohort.replay,
            tasks,
            scheduler=cluster,
            progress=lambda done, total, text: counts.append((done, total, text)),
        )
    )
    assert table(serial, tmp_path / "a.csv") == table(parallel, tmp_path / "b.csv")
    assert counts == [(n, 9, "") for n in range(1, 10)]
    assert len({row["hash"] for row in cohort.rows_of(serial)}) == 9
    assert [outcome.parameters["path"] for outcome in parallel] == captures


def test_a_worker_that_dies_loses_nothing(cluster, tmp_path):
    log = str(tmp_path / "log")
    tasks = cohort.sweep(shift=[n for n in range(20) if n != 5], rows=[6], log=[log])
    outcomes, killed = [], None
    for outcome in cohort.run(depth, tasks, scheduler=cluster):
        outcomes.append(outcome)
        if killed is None:
            killed = int(pathlib.Path(log).read_text().split()[-1])
            os.kill(killed, signal.SIGKILL)
    assert [outcome.task for outcome in outcomes] == list(range(19))
    assert not any(outcome.error for outcome in outcomes)
    begun = [line.split()[0] for line in pathlib.Path(log).read_text().splitlines()]
    assert set(begun) == {str(task["shift"]) for task in tasks}
    assert len(begun) > len(tasks), "the task of the worker that died did not run again"
    serial = list(cohort.run(depth, tasks, workers=0))
    assert table(serial, tmp_path / "a.csv") == table(outcomes, tmp_path / "b.csv")


def test_a_cluster_that_dask_closed_is_started_again(monkeypatch, tmp_path):
    """All workers leave after the first answer, and no new one comes by itself."""
    clusters, examined, examine = [], [], cohort._lost

    def examine_again(*arguments):
        examined.append(arguments)
        assert len(examined) < 20, "no cluster was started again"
        return examine(*arguments)

    class Recorded(distributed.LocalCluster):
        def __init__(self, **options):
            super().__init__(**options)
            clusters.append(self)

    monkeypatch.setattr(distributed, "LocalCluster", Recorded)
    monkeypatch.setattr(cohort, "PATIENCE", 1.0)
    monkeypatch.setattr(cohort, "_lost", examine_again)
    log = str(tmp_path / "log")
    tasks = cohort.sweep(shift=[0, 1, 2, 3, 4, 6], rows=[6], log=[log])
    outcomes = []
    for outcome in cohort.run(depth, tasks, workers=1):
        outcomes.append(outcome)
        if len(outcomes) == 1:
            clusters[0].scale(0)
    assert len(clusters) >= 2
    assert not any(outcome.error for outcome in outcomes)
    serial = list(cohort.run(depth, tasks, workers=0))
    assert table(serial, tmp_path / "a.csv") == table(outcomes, tmp_path / "b.csv")


@pytest.mark.parametrize("parallel", [False, True])
def test_failed_tasks_are_tried_again_and_reported(cluster, tmp_path, parallel):
    log = str(tmp_path / "log")
    where = {"scheduler": cluster} if parallel else {"workers": 0}
    tasks = cohort.sweep(shift=[4, 5, 6], rows=[6], log=[log])
    outcomes = list(cohort.run(depth, tasks, retries=1, folder=tmp_path / "failed", **where))
    assert [outcome.attempts for outcome in outcomes] == [1, 2, 1]
    assert pathlib.Path(log).read_text().count("5 ") == 2
    failed = outcomes[1]
    assert failed.error == "ValueError: no five" and failed.value is None
    problem = palpate.read_capture(failed.capture)
    assert np.array_equal(problem.geometries[1].now, Balls(6).positions + [2.05 - 0.005, 0, 0])
    row = cohort.rows_of(outcomes)[1]
    assert row["error"] == failed.error and row["capture"] == failed.capture
    cohort.write_table(outcomes, tmp_path / "table.csv")
    with open(tmp_path / "table.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:4] == ["task", "shift", "rows", "log"] and rows[1]["nearest"] == ""
    assert float(rows[0]["nearest"]) == outcomes[0].value["nearest"]


def test_parquet(tmp_path, monkeypatch):
    """Debian has no pyarrow: where it is absent, its two functions are replaced here."""
    tasks = cohort.sweep(a=[1, 2], b=[0.1])
    outcomes = list(cohort.run(lambda a, b: {"sum": a + b}, tasks, workers=0))
    path = tmp_path / "table.parquet"
    if importlib.util.find_spec("pyarrow") is not None:
        cohort.write_table(outcomes, path)
        rows = importlib.import_module("pyarrow.parquet").read_table(path).to_pylist()
    else:
        written = {}
        writer = types.SimpleNamespace(write_table=lambda table, to: written.update({to: table}))
        monkeypatch.setitem(sys.modules, "pyarrow", types.SimpleNamespace(table=dict))
        monkeypatch.setitem(sys.modules, "pyarrow.parquet", writer)
        cohort.write_table(outcomes, path)
        columns = written[str(path)]
        rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values())]
    assert rows == cohort.rows_of(outcomes) and rows[1]["sum"] == 2.1


def test_the_command(captures, tmp_path):
    (tmp_path / "study.py").write_text("def power(base, exponent):\n    return base**exponent\n")

    def run(*arguments):
        command = [sys.executable, "-m", "palpate.cohort", "--workers", "0", *arguments]
        return subprocess.run(command, cwd=tmp_path, **SINGLE)

    swept = run("--call", "study:power", "base=2,0", "exponent=3,-1", "--output", "p.csv")
    assert swept.returncode == 1 and "task 3 failed: ZeroDivisionError" in swept.stderr
    assert (tmp_path / "p.csv").read_text().splitlines()[1] == "0,2,3,8,,"
    folder = sequences.made(sequences.pierced_membrane, tmp_path)
    mixed = run(captures[0], str(folder), "--output", "mixed.csv")
    assert mixed.returncode == 0, mixed.stderr
    with open(tmp_path / "mixed.csv", newline="") as file:
        first, second = csv.DictReader(file)
    assert first["method"] == "PROXIMITY" and second["frames"] == "8"
    assert int(second["crossing"]) > 0
    assert run("no/such/file").returncode == 2


def test_long_sequences(tmp_path):
    """palpate-check with workers of its own has the files of a check without."""
    folder = sequences.made(sequences.cloth_that_tears, tmp_path)
    (folder / "cloth0001.ply").unlink()
    for name, options in (("serial", []), ("parallel", ["--workers", "2"])):
        command = [sys.executable, "-m", "palpate.check", folder, "--svg", *options]
        done = subprocess.run([*command, "--output", tmp_path / name], cwd=tmp_path, **SINGLE)
        assert done.returncode == 2, done.stderr
    assert {p.name for p in tmp_path.iterdir()} == {folder.name, "serial", "parallel"}
    files = sorted(p.relative_to(tmp_path / "serial") for p in (tmp_path / "serial").rglob("*"))
    assert len(files) > 4
    for file in files:
        if (tmp_path / "serial" / file).is_file():
            ours, other = (tmp_path / name / file for name in ("serial", "parallel"))
            assert ours.read_bytes() == other.read_bytes(), file
