"""Many scenes at once: captures, sequences or a parameter sweep, on Dask distributed.

    from palpate import cohort

    def depth(thickness):
        ...
        return {"depth": deepest}

    if __name__ == "__main__":  # workers import the program
        tasks = cohort.sweep(thickness=[0.1, 0.2, 0.4])
        outcomes = list(cohort.run(depth, tasks, workers=4))
        cohort.write_table(outcomes, "depths.csv")

Results have the order of the tasks, and are the same for any number of workers. A task whose
worker dies runs again. `python3 -m palpate.cohort --help` describes the command.
"""

import argparse
import contextlib
import csv
import importlib
import itertools
import json
import logging
import os
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from palpate._palpate import OctreeBasedCD, capture, read_capture, set_up
from palpate._progress import Progress

__all__ = ["Outcome", "replay", "rows_of", "run", "sweep", "watch", "write_table"]

Parameters = Mapping[str, Any]
Function = Callable[..., Any]


class Outcome(NamedTuple):
    """What became of a task.

    task        its number
    parameters  with which the function was called
    value       what it returned; None if it failed
    error       why it failed; "" if it did not
    capture     the file with the frame in which it failed; "" without one
    attempts    how often it was tried
    """

    task: int
    parameters: Parameters
    value: Any
    error: str = ""
    capture: str = ""
    attempts: int = 1


class _Failure(NamedTuple):
    """Comes back from a worker, because captures do not travel with exceptions."""

    error: str
    capture: str


# Seconds without an answer of Dask until its state is examined.
PATIENCE = 20.0
# How often a task runs again, beside its retries, because Dask lost it.
LOSSES = 3

_local = threading.local()


def watch(collisions: OctreeBasedCD) -> OctreeBasedCD:
    """If the task that calls this fails, the last frame of this object is its capture."""
    _local.watched = collisions
    return collisions


def sweep(**values: Iterable[Any]) -> list[dict[str, Any]]:
    """The tasks of all combinations: sweep(a=[1, 2], b=[3]) has (1, 3) and (2, 3)."""
    rows = itertools.product(*values.values())
    return [dict(zip(values, row, strict=True)) for row in rows]


def run(
    function: Function,
    tasks: Iterable[Parameters],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retries: int = 2,
    folder: str | os.PathLike[str] = "palpate-cohort",
    progress: Callable[[int, int, str], object] | None = None,
) -> Iterator[Outcome]:
    """Calls function(**parameters) for each task, and yields the outcomes in the order of tasks.

    workers    processes of a local cluster; None: one per core; 0: this process, without Dask
    scheduler  the address of a Dask scheduler, instead of a local cluster
    retries    how often a task that failed is tried again
    folder     for captures of failed tasks; made when one is written
    progress   progress(done, total, text): called after each task
    """
    work = list(tasks)
    if workers == 0 and scheduler is None:
        outcomes = _in_order(_serially(function, work, retries))
    else:
        outcomes = _in_order(_distributed(function, work, workers, scheduler, retries))
    failed = 0
    for done, outcome in enumerate(outcomes, 1):
        if outcome.error:
            failed += 1
            if outcome.capture:
                path = Path(folder) / f"task{outcome.task:06d}.txt"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(outcome.capture)
                outcome = outcome._replace(capture=str(path))
        if progress is not None:
            progress(done, len(work), f"{failed} failed" if failed else "")
        yield outcome


def _attempt(function: Function, parameters: Parameters) -> Any:
    """Runs in a worker."""
    _local.watched = None
    try:
        return function(**parameters)
    except Exception as error:
        text = "".join(traceback.format_exception_only(type(error), error)).strip()
        return _Failure(text, _capture_of(getattr(_local, "watched", None)))
    finally:
        _local.watched = None


def _capture_of(collisions: OctreeBasedCD | None) -> str:
    if collisions is None:
        return ""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "capture.txt"
        try:
            capture(collisions, path)
        except Exception as error:
            return f"no capture: {error}\n"
        return path.read_text()


def _outcome(task: int, parameters: Parameters, result: Any, attempts: int) -> Outcome:
    if isinstance(result, _Failure):
        return Outcome(task, parameters, None, result.error, result.capture, attempts)
    return Outcome(task, parameters, result, attempts=attempts)


def _serially(function: Function, tasks: list[Parameters], retries: int) -> Iterator[Outcome]:
    for number, parameters in enumerate(tasks):
        for attempt in range(1, retries + 2):
            result = _attempt(function, parameters)
            if not isinstance(result, _Failure):
                break
        yield _outcome(number, parameters, result, attempt)


def _distributed(
    function: Function,
    tasks: list[Parameters],
    workers: int | None,
    scheduler: str | None,
    retries: int,
) -> Iterator[Outcome]:
    """In any order. Only a few tasks wait at the scheduler, so that few results are in memory."""
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise ImportError(f"{error}: install Dask distributed, or use no workers (0)") from None
    with contextlib.ExitStack() as stack:
        client = _connected(stack, distributed, workers, scheduler)
        waiting = [(number, 1) for number in reversed(range(len(tasks)))]
        running: dict[Any, tuple[int, int]] = {}
        while waiting or running:
            most = 2 * max(2, sum(client.ncores().values()))
            while waiting and len(running) < most:
                number, attempt = waiting.pop()
                future = client.submit(_attempt, function, tasks[number], pure=False)
                running[future] = number, attempt
            try:
                done, _ = distributed.wait(list(running), PATIENCE, "FIRST_COMPLETED")
            except TimeoutError:
                lost = _lost(client, list(running))
                if scheduler is None and not client.ncores():  # Dask has shut its workers down
                    lost = list(running)
                    stack.close()
                    client = _connected(stack, distributed, workers, scheduler)
                for future in lost:
                    number, attempt = running.pop(future)
                    if attempt < retries + LOSSES:
                        waiting.append((number, attempt + 1))
                    else:
                        failure = _Failure("the worker died each time", "")
                        yield _outcome(number, tasks[number], failure, attempt)
                continue
            for future in done:
                number, attempt = running.pop(future)
                try:
                    result = future.result(PATIENCE)
                except TimeoutError:  # the worker that has the result died
                    waiting.append((number, attempt))
                    continue
                except Exception as error:
                    text = f"{type(error).__name__}: {error}"
                    if isinstance(error, distributed.scheduler.KilledWorker):
                        text = "KilledWorker: several workers died while they ran the task"
                    result = _Failure(text, "")
                if isinstance(result, _Failure) and attempt <= retries:
                    waiting.append((number, attempt + 1))
                else:
                    yield _outcome(number, tasks[number], result, attempt)


def _connected(
    stack: contextlib.ExitStack, distributed: Any, workers: int | None, scheduler: str | None
) -> Any:
    """A client of a scheduler, or of a local cluster. The stack closes both."""
    address: Any = scheduler
    if scheduler is None:
        cluster = distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            local_directory=stack.enter_context(tempfile.TemporaryDirectory()),
            silence_logs=logging.ERROR,
        )
        address = stack.enter_context(cluster)
    return stack.enter_context(distributed.Client(address))


def _lost(client: Any, futures: list[Any]) -> list[Any]:
    """Futures whose task is at no worker. Dask may forget to report one when its worker dies."""
    keys = [future.key for future in futures]
    states = client.run_on_scheduler(
        lambda dask_scheduler: [
            dask_scheduler.tasks[key].state if key in dask_scheduler.tasks else "lost"
            for key in keys
        ]
    )
    working = ("waiting", "processing", "queued", "no-worker")
    return [future for future, state in zip(futures, states, strict=True) if state not in working]


def _in_order(outcomes: Iterator[Outcome]) -> Iterator[Outcome]:
    kept: dict[int, Outcome] = {}
    following = 0
    for outcome in outcomes:
        kept[outcome.task] = outcome
        while following in kept:
            yield kept.pop(following)
            following += 1


def rows_of(outcomes: Iterable[Outcome]) -> list[dict[str, Any]]:
    """Rows of one table: the task, its parameters, the values, and error and capture.

    A value is a mapping of columns, a list of them for several rows, or anything else for the
    column "value".
    """
    rows = []
    for outcome in outcomes:
        values = outcome.value if isinstance(outcome.value, list) else [outcome.value]
        for value in values:
            row: dict[str, Any] = {"task": outcome.task, **outcome.parameters}
            if isinstance(value, Mapping):
                row.update(value)
            elif not outcome.error:
                row["value"] = value
            rows.append({**row, "error": outcome.error, "capture": outcome.capture})
    return rows


def write_table(outcomes: Iterable[Outcome], path: str | os.PathLike[str]) -> None:
    """Writes rows_of() to a .csv file, or to a .parquet file, which needs pyarrow."""
    rows = rows_of(outcomes)
    last = ("error", "capture")
    columns = list(dict.fromkeys(key for row in rows for key in row if key not in last))
    columns += last
    if Path(path).suffix.lower() == ".parquet":
        arrow: Any = importlib.import_module("pyarrow")
        parquet: Any = importlib.import_module("pyarrow.parquet")
        lists = {column: [row.get(column) for row in rows] for column in columns}
        parquet.write_table(arrow.table(lists), os.fspath(path))
        return
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)


def replay(path: str) -> list[dict[str, Any]]:
    """The answers of a capture: a row for each pair."""
    problem = read_capture(path)
    collisions = watch(set_up(problem))
    collisions.detect_collision()
    rows = []
    for pair in problem.pairs:
        data = collisions.collision_data(pair.a, pair.b)
        lists = (data.vertex_triangle, data.triangle_vertex, data.edge_edge)
        rows.append(
            {
                "a": pair.a,
                "b": pair.b,
                "method": data.validity.method.name,
                "contacts": sum(map(len, (*lists, data.shape, data.shape_shape))),
                "intersecting": len(data.intersecting_triangles),
                "earliest_time": data.earliest_time_of_impact,
                "trusted": data.validity.trusted,
                "hash": f"{data.hash():016x}",
            }
        )
    return rows


HELP = """\
Runs many scenes on Dask distributed and writes one table.

A task is a capture, which is replayed; a folder with a sequence, which palpate-check
checks; or with --call one combination of parameters, with which a function of yours is
called. The function returns a dict, which becomes the columns of a row. The table has the
order of the tasks, and is the same for any number of workers. A task that fails is tried
again, and then has a row with its error and its capture. Tasks of a worker that dies run
again.
"""
EXAMPLES = """\
examples:
  python3 -m palpate.cohort captures/*.txt --output answers.csv
  python3 -m palpate.cohort runs/* --scheduler tcp://10.0.0.1:8786
  python3 -m palpate.cohort --call study:depth thickness=0.1,0.2 speed=1,2,4 --workers 8

exit status:
  0  all tasks succeeded
  1  a task failed
  2  the command is wrong
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command `python3 -m palpate.cohort`."""
    parser = argparse.ArgumentParser(
        prog="palpate.cohort",
        description=HELP,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("tasks", nargs="+", metavar="TASK", help="a capture, a folder, or NAME=VALUE,VALUE...")
    add("--call", metavar="MODULE:FUNCTION", help="the function of a parameter sweep")
    add("--output", default="cohort.csv", help="the table, .csv or .parquet (default: cohort.csv)")
    add("--captures", default="palpate-cohort", help="folder for captures of failed tasks")
    add_cluster_options(parser, "one per core")
    add("--retries", type=int, default=2, help="how often a failed task is tried again")
    add("--quiet", action="store_true", help="no progress")
    options = parser.parse_args(arguments)
    try:
        function, tasks = _tasks_of(options.call, options.tasks)
    except (ValueError, ImportError, AttributeError) as error:
        parser.error(str(error))
    running = run(
        function,
        tasks,
        workers=options.workers,
        scheduler=options.scheduler,
        retries=options.retries,
        folder=options.captures,
        progress=Progress("palpate.cohort", options.quiet),
    )
    try:
        outcomes = list(running)
    except (ImportError, OSError) as error:  # no Dask, or no scheduler at the address
        parser.error(str(error))
    write_table(outcomes, options.output)
    failed = [outcome for outcome in outcomes if outcome.error]
    for outcome in failed:
        print(f"task {outcome.task} failed: {outcome.error} {outcome.capture}", file=sys.stderr)
    print(f"{len(outcomes)} tasks, {len(failed)} failed: {options.output}")
    return 1 if failed else 0


def add_cluster_options(parser: argparse.ArgumentParser, default: str) -> None:
    """default: what the command does without them, in words."""
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help=f"processes of a local cluster; 0: this process, without Dask (default: {default})",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler, as tcp://10.0.0.1:8786"
    )


def _tasks_of(call: str | None, items: list[str]) -> tuple[Function, list[dict[str, Any]]]:
    if call is None:
        missing = [item for item in items if not os.path.exists(item)]
        if missing:
            raise ValueError(f"{missing[0]}: no such file or folder")
        return replay_or_check, [{"path": item} for item in items]
    module, colon, name = call.partition(":")
    if not colon:
        raise ValueError(f"--call {call}: it must be MODULE:FUNCTION")
    sys.path.insert(0, os.getcwd())
    function = getattr(importlib.import_module(module), name)
    values = {}
    for item in items:
        parameter, equals, listed = item.partition("=")
        if not equals:
            raise ValueError(f"{item}: it must be NAME=VALUE,VALUE...")
        values[parameter] = [_value(text) for text in listed.split(",")]
    return function, sweep(**values)


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def replay_or_check(path: str) -> Any:
    """The rows of a capture, or the number of findings of each kind in a folder's sequence."""
    if not os.path.isdir(path):
        return replay(path)
    from palpate.check import count_findings  # it imports this module

    return count_findings(path)


if __name__ == "__main__":
    # By the module's own name, under which workers import it.
    sys.exit(importlib.import_module("palpate.cohort").main())
