"""palpate-check: a second opinion on the frames that another simulator wrote.

`palpate-check --help` describes the command. Docs/HowTo/CheckASequence.md has an example.
"""

import argparse
import functools
import importlib
import itertools
import os
import sys
from collections.abc import Iterator
from collections.abc import Sequence as Arguments
from dataclasses import replace
from pathlib import Path
from typing import Any

from palpate._captures import write_capture_of
from palpate._errors import BadInput, Error
from palpate._findings import Checker, Finding
from palpate._frames import Reader
from palpate._pictures import drawn, pictures_of
from palpate._progress import Progress
from palpate._replay import replay_of
from palpate._report import (
    COLOURS,
    NO_FAULTS,
    FindingsTable,
    Picture,
    Summary,
    page_of,
    text_of,
)
from palpate._sequence import Sequence, find_sequence, read_bodies
from palpate.cohort import add_cluster_options, run

LONGEST_TASK = 25  # frames
ROWS_ON_THE_TERMINAL = 30
IMPORTANT_FRAMES = 200  # that the 3D view holds before others

HELP = """\
Finds what is wrong in the frames that a simulator wrote: penetrations of two bodies,
crossings within a step, self-intersections, inverted tetrahedra. A step is straight motion
from one frame to the next. The library decides exactly.

FOLDER has a file for each body and frame, as cloth_0001.vtp: mesh files (.obj, .ply, .stl,
.vtk, .vtp, .vtu, .msh, .mesh) or .npz. Files without a number are bodies at rest. ParaView's
.pvd and .series files are read, too. An .npz file has arrays `positions`, (n, 3) or (frames,
n, 3), and `triangles`, `tetrahedra` or `segments`; of several bodies `cloth.positions` and so
on.
"""
EXAMPLES = """\
bodies in a TOML file:
  pairs = [["thread", "skin"], ["skin", "skin"]]  # default: all, and each with itself

  [bodies.thread]
  files = "thread_*.vtp"  # a glob in FOLDER
  radius = 0.2            # of lines and points, in the unit of the files
  [bodies.skin]
  files = "skin_*.npz"
  topology = "skin.obj"   # the elements, where .npz files have positions only
  weld = 0.0              # joins vertices at most this far apart; default: 0 for .stl
  itself = false          # no test against itself

files in the output folder:
  findings.csv  a row for each finding
  report.txt    a row for each frame, kind and pair of bodies
  report.html   the same with pictures and the frames in 3D
  captures/     the worst findings as captures of a few elements, for palpate.read_capture()

exit status:
  0  nothing found, or only surfaces that touch
  1  findings
  2  wrong input: the command, or a frame that is missing or cannot be read

examples:
  palpate-check run42
  palpate-check run42 --body "organ=liver_*.vtu" --body "tool=tool.stl"
  palpate-check run42 --bodies bodies.toml --workers 8 --output report42
"""


def parser() -> argparse.ArgumentParser:
    result = argparse.ArgumentParser(
        prog="palpate-check",
        description=HELP,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = result.add_argument
    add("folder", metavar="FOLDER", type=Path, help="the sequence")
    add("--body", action="append", default=[], metavar="NAME=GLOB", help="a body and its files")
    add("--bodies", type=Path, metavar="FILE", help="bodies and pairs in a TOML file")
    add("--pair", action="append", default=[], metavar="A,B", help="bodies to test; A,A: itself")
    add("--output", type=Path, default=Path("palpate-check"), help="default: palpate-check")
    add("--captures", type=int, default=10, metavar="N", help="most captures (default: 10)")
    add("--pictures", type=int, default=6, metavar="N", help="most pictures (default: 6)")
    add("--svg", action="store_true", help="draw pictures without VTK")
    add("--touch", action="store_true", help="surfaces that touch are findings, too")
    add("--threads", type=int, default=0, help="threads of a process; 0: one per core")
    add_cluster_options(result, "0")
    add("--quiet", action="store_true", help="no progress and no table on the terminal")
    return result


def main(arguments: Arguments[str] | None = None) -> int:
    """The command palpate-check."""
    command = parser()
    options = command.parse_args(arguments)
    try:
        sequence = _sequence_of(options)
        return _check(sequence, options)
    except (BadInput, Error, OSError, ImportError) as error:
        print(f"palpate-check: {error}", file=sys.stderr)
        return 2


def _sequence_of(options: argparse.Namespace) -> Sequence:
    bodies: dict[str, dict[str, Any]] = {}
    pairs: list[tuple[str, str]] = []
    if options.bodies is not None:
        bodies, pairs = read_bodies(options.bodies)
    for text in options.body:
        name, equals, glob = text.partition("=")
        if not equals:
            raise BadInput(f"--body {text}: it must be NAME=GLOB")
        bodies.setdefault(name, {})["files"] = glob
    for text in options.pair:
        a, comma, b = text.partition(",")
        if not comma:
            raise BadInput(f"--pair {text}: it must be A,B")
        pairs.append((a, b))
    return find_sequence(options.folder, bodies, pairs)


def _check(sequence: Sequence, options: argparse.Namespace) -> int:
    options.output.mkdir(parents=True, exist_ok=True)
    notes = dict.fromkeys(sequence.notes)
    summary = Summary()
    table = FindingsTable(options.output / "findings.csv", sequence)
    progress = Progress("palpate-check", options.quiet)
    try:
        frames = len(sequence.numbers)
        for done, (found, new_notes) in enumerate(findings_of(sequence, options), 1):
            notes.update(dict.fromkeys(new_notes))
            for finding in found:
                table.add(finding)
                summary.add(finding)
            progress(done, frames, f"{sum(summary.counts.values())} findings")
    finally:
        table.close()
    captures = _write_captures(sequence, summary, options)
    _write_report(sequence, summary, list(notes), captures, options)
    counts = summary.counts
    if counts["unreadable"]:
        return 2
    faults = [kind for kind in counts if options.touch or kind not in NO_FAULTS]
    return 1 if faults else 0


def findings_of(
    sequence: Sequence, options: argparse.Namespace
) -> Iterator[tuple[list[Finding], list[str]]]:
    """Findings and notes of each frame, by this process or by workers."""
    if not options.workers and options.scheduler is None:
        checker = Checker(sequence, options.threads)
        for found in checker.check(0, len(sequence.numbers)):
            yield found, sorted(checker.notes)
        return
    frames = len(sequence.numbers)
    length = max(1, min(LONGEST_TASK, -(-frames // (4 * (options.workers or 4)))))
    starts = range(0, frames, length)
    tasks = [
        {"sequence": _part_of(sequence, first, first + length), "first": first, "length": length}
        for first in starts
    ]
    function = functools.partial(check_part, threads=options.threads or 1)
    for outcome in run(
        function, tasks, workers=options.workers, scheduler=options.scheduler
    ):
        if outcome.error:  # nothing is lost: each frame of the task is reported
            first = starts[outcome.task]
            for number in sequence.numbers[first : first + length]:
                text = f"frame {number}: the worker failed: {outcome.error}"
                yield [Finding(number, "unreadable", "", text=text)], []
        else:
            yield from outcome.value


def check_part(
    sequence: Sequence, first: int, length: int, threads: int
) -> list[tuple[list[Finding], list[str]]]:
    """A task: some frames, and the steps that end there."""
    checker = Checker(sequence, threads)
    last = min(first + length, len(sequence.numbers))
    return [(found, sorted(checker.notes)) for found in checker.check(first, last)]


def _part_of(sequence: Sequence, first: int, last: int) -> Sequence:
    """What a task needs: its own frames, the one before, and the first."""
    needed = {sequence.numbers[0], *sequence.numbers[max(first - 1, 0) : last]}
    bodies = [
        replace(body, sources={n: s for n, s in body.sources.items() if n in needed})
        for body in sequence.bodies
    ]
    return replace(sequence, bodies=tuple(bodies))


def _write_captures(
    sequence: Sequence, summary: Summary, options: argparse.Namespace
) -> dict[tuple[int, str, str, str], Path]:
    folder = options.output / "captures"
    reader = Reader(sequence)
    captures = {}
    for old in folder.glob("frame*.txt"):
        old.unlink()
    for finding in summary.worst(options.captures):
        folder.mkdir(exist_ok=True)
        path = write_capture_of(sequence, reader, finding, folder)
        captures[finding.group] = path.relative_to(options.output)
    return captures


def _write_report(
    sequence: Sequence,
    summary: Summary,
    notes: list[str],
    captures: dict[tuple[int, str, str, str], Path],
    options: argparse.Namespace,
) -> None:
    reader = Reader(sequence)
    worst = summary.worst(options.pictures)
    scenes = [drawn(sequence, reader, finding) for finding in worst]
    markup = pictures_of(scenes, vtk=not options.svg)
    pictures = [Picture(f, m) for f, m in zip(worst, markup, strict=True)]
    important = dict.fromkeys(finding.frame for finding in summary.worst(IMPORTANT_FRAMES))
    replay = replay_of(sequence, reader, options.output / "findings.csv", important, COLOURS)
    page = page_of(summary, sequence, notes, pictures, captures, replay)
    (options.output / "report.html").write_text(page, encoding="utf-8")
    (options.output / "report.txt").write_text(
        text_of(summary, sequence, notes), encoding="utf-8"
    )
    if not options.quiet:
        sys.stdout.write(text_of(summary, sequence, notes, ROWS_ON_THE_TERMINAL))
        print(f"report: {options.output / 'report.html'}")


def count_findings(folder: str | os.PathLike[str]) -> dict[str, int]:
    """The number of frames, and of findings of each kind, in the sequence of a folder."""
    sequence = find_sequence(Path(folder), {}, [])
    checker = Checker(sequence, threads=1)
    summary = Summary()
    for finding in itertools.chain.from_iterable(checker.check(0, len(sequence.numbers))):
        summary.add(finding)
    return {"frames": len(sequence.numbers), **dict(sorted(summary.counts.items()))}


if __name__ == "__main__":
    # By the module's own name, under which workers import it.
    sys.exit(importlib.import_module("palpate.check").main())
