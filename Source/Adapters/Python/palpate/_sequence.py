"""Sequences of frames that another program wrote: the files of each body."""

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from palpate._errors import BadInput
from palpate._npz import bodies_of_npz

MESH_FILES = (".obj", ".ply", ".stl", ".vtk", ".vtp", ".vtu", ".msh", ".mesh")
LISTS = (".pvd", ".series")


class Source(NamedTuple):
    """One frame of a body.

    path  a mesh file or an NPZ file
    body  what precedes the names of the arrays in an NPZ file, as "cloth."
    row   the frame, of positions (frames, n, 3); None: they are (n, 3)
    """

    path: str
    body: str = ""
    row: int | None = None


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body and where its frames are.

    sources   by frame number
    still     the only source of a body that is at rest in all frames
    topology  a file with the elements, for NPZ files that have positions only
    radius    L, of lines and points
    weld      L: joins vertices at most this far apart; None: those of STL files at equal positions
    itself    whether the body is tested against itself
    """

    name: str
    sources: dict[int, Source] = field(default_factory=dict)
    still: Source | None = None
    topology: str | None = None
    radius: float = 0.0
    weld: float | None = None
    itself: bool = True


@dataclass(frozen=True, kw_only=True)
class Sequence:
    """Bodies with their frames.

    numbers  frame numbers, ascending; includes frames that are missing between others
    times    the time of each frame, if the files tell
    pairs    names of two bodies each, or of one body twice
    notes    what a reader of the report should know
    """

    bodies: tuple[Body, ...]
    numbers: tuple[int, ...]
    times: dict[int, float]
    pairs: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


class _Found:
    """Bodies while their files are collected."""

    def __init__(self) -> None:
        self.bodies: dict[str, Body] = {}
        self.times: dict[int, float] = {}
        self.listed: set[Path] = set()
        self.notes: list[str] = []

    def add(self, name: str, number: int | None, source: Source) -> None:
        body = self.bodies.setdefault(name, Body(name=name))
        old = body.still if number is None else body.sources.get(number)
        if old is not None:
            frame = "" if number is None else f", frame {number}"
            raise BadInput(f'body "{name}"{frame}: two files, {old.path} and {source.path}')
        if number is None:
            self.bodies[name] = replace(body, still=source)
        else:
            body.sources[number] = source

    def add_file(self, name: str, number: int | None, path: Path, only: bool = False) -> None:
        """only: of the bodies in an NPZ file the one with this name, if there are several."""
        if path.suffix.lower() != ".npz":
            self.add(name, number, Source(str(path)))
            return
        bodies = bodies_of_npz(path)
        if only and len(bodies) > 1:
            bodies = [(body, shape) for body, shape in bodies if body == f"{name}."]
            if not bodies:
                raise BadInput(f'{path}: no array "{name}.positions"')
        for body, shape in bodies:
            own = name if only else body.rstrip(".") or name
            source = Source(str(path), body)
            if len(shape) == 2:
                self.add(own, number, source)
            elif shape[0] == 0:
                raise BadInput(f'{path}, body "{own}": the positions have no frames')
            else:
                for row in range(shape[0]):
                    self.add(own, row, source._replace(row=row))

    def add_list(self, path: Path) -> None:
        """A .pvd or .series file: files with times."""
        entries = list(_entries(path))
        if not entries:
            raise BadInput(f"{path}: it names no file")
        numbers = {time: n for n, time in enumerate(sorted({time for time, _, _ in entries}))}
        name = path.name.split(".")[0]
        parts = {part for _, part, _ in entries}
        for time, number in numbers.items():
            if self.times.setdefault(number, time) != time:
                raise BadInput(
                    f"{path}: frame {number} has the time {time}, but in another list "
                    f"{self.times[number]}"
                )
        for time, part, file in entries:
            self.listed.add(file.resolve())
            own = name if len(parts) == 1 else f"{name}.{part}"
            if file.suffix.lower() == ".vtm":
                for block, inner in _blocks(file):
                    self.listed.add(inner.resolve())
                    self.add_file(block, numbers[time], inner)
            else:
                self.add_file(own, numbers[time], file)


def find_sequence(
    folder: Path, bodies: dict[str, dict[str, Any]], pairs: list[tuple[str, str]]
) -> Sequence:
    """The sequence in a folder.

    bodies  for each name its options, as in a TOML file: files (a glob), topology, radius, weld,
            itself. Empty: every file and series of the folder.
    pairs   empty: every two bodies, and every body with itself
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder")
    found = _Found()
    if bodies:
        for name, options in bodies.items():
            _add_files(found, folder, name, options)
    else:
        lists = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in LISTS]
        for path in lists:
            found.add_list(path)
        others = set()
        for path in sorted(folder.iterdir()):
            if path.resolve() in found.listed or path in lists or not path.is_file():
                continue
            if path.suffix.lower() in (*MESH_FILES, ".npz"):
                stem, number = _number(path)
                found.add_file(stem, number, path)
            else:
                others.add(path.suffix or path.name)
        if others:
            found.notes.append(f"files of other formats are not read: {', '.join(sorted(others))}")
    if not found.bodies:
        kinds = ", ".join((*MESH_FILES, ".npz", *LISTS))
        raise BadInput(f"{folder}: no frames; files of these formats are read: {kinds}")
    return _sequence(found, pairs)


def _sequence(found: _Found, pairs: list[tuple[str, str]]) -> Sequence:
    notes = found.notes
    bodies = []
    most = max(len(body.sources) for body in found.bodies.values())
    for body in found.bodies.values():
        if body.still is not None and body.sources:
            (number, source), *_ = body.sources.items()
            raise BadInput(
                f'body "{body.name}": {body.still.path} has no frame number, but {source.path} has'
            )
        if len(body.sources) == 1 and most > 1:
            body = replace(body, still=next(iter(body.sources.values())), sources={})
        if body.still is not None:
            notes.append(f'body "{body.name}" has one file: it is at rest in all frames')
        bodies.append(body)
    numbers, note = _with_gaps(sorted({n for body in bodies for n in body.sources}) or [0])
    notes += note
    names = {body.name for body in bodies}
    for name in {name for pair in pairs for name in pair} - names:
        raise BadInput(f'the pairs name the body "{name}"; bodies are {", ".join(sorted(names))}')
    if not pairs:
        pairs = [
            (a.name, b.name)
            for i, a in enumerate(bodies)
            for b in bodies[i:]
            if a is not b or a.itself
        ]
    return Sequence(
        bodies=tuple(bodies),
        numbers=tuple(numbers),
        times=found.times,
        pairs=tuple(pairs),
        notes=tuple(notes),
    )


def _add_files(found: _Found, folder: Path, name: str, options: dict[str, Any]) -> None:
    """A body that the caller names, with its options."""
    kinds = {"files": str, "topology": str, "radius": float, "weld": float, "itself": bool}
    for key, value in options.items():
        kind = kinds.get(key)
        if kind is None:
            raise BadInput(f'body "{name}": no option "{key}"; options are {", ".join(kinds)}')
        if not isinstance(value, (int, float) if kind is float else kind):
            raise BadInput(f'body "{name}": {key} = {value!r} is no {kind.__name__}')
    glob = options.get("files")
    if not glob:
        raise BadInput(f'body "{name}": the option "files" is missing')
    paths = sorted(path for path in folder.glob(glob) if path.is_file())
    if not paths:
        raise BadInput(f'body "{name}": no file {folder / glob}')
    for path in paths:
        if path.suffix.lower() in LISTS:
            own = _Found()
            own.add_list(path)
            if len(own.bodies) != 1:
                raise BadInput(f'body "{name}": {path} has {len(own.bodies)} bodies')
            (body,) = own.bodies.values()
            found.times.update(own.times)
            for number, source in body.sources.items():
                found.add(name, number, source)
        else:
            found.add_file(name, _number(path)[1], path, only=True)
    topology = options.get("topology")
    found.bodies[name] = replace(
        found.bodies[name],
        topology=None if topology is None else str(folder / topology),
        radius=float(options.get("radius", 0.0)),
        weld=options.get("weld"),
        itself=options.get("itself", True),
    )


def read_bodies(path: Path) -> tuple[dict[str, dict[str, Any]], list[tuple[str, str]]]:
    """Bodies and pairs of a TOML file."""
    try:
        content = tomllib.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: {error}") from None
    for key in content:
        if key not in ("bodies", "pairs"):
            raise BadInput(f'{path}: no key "{key}"; keys are bodies, pairs')
    bodies, pairs = content.get("bodies", {}), content.get("pairs", [])
    if not isinstance(bodies, dict) or not all(isinstance(b, dict) for b in bodies.values()):
        raise BadInput(f"{path}: bodies must be tables, as [bodies.cloth]")
    if not isinstance(pairs, list) or not all(
        isinstance(pair, list) and len(pair) == 2 and all(isinstance(n, str) for n in pair)
        for pair in pairs
    ):
        raise BadInput(f'{path}: pairs must be lists of two names, as [["cloth", "liver"]]')
    return bodies, [(a, b) for a, b in pairs]


def _number(path: Path) -> tuple[str, int | None]:
    """The name of a body and the frame number in a file name: ("cloth", 12) of cloth_0012.vtp."""
    match = re.fullmatch(r"(.*?)[_.-]*(\d+)", path.stem)
    if match is None:
        return path.stem, None
    return match[1] or "body", int(match[2])


def _with_gaps(numbers: list[int]) -> tuple[list[int], list[str]]:
    """Frame numbers with those that are missing, if the numbers have a constant step."""
    differences = [b - a for a, b in zip(numbers, numbers[1:], strict=False)]
    step = min(differences, default=1)
    whole = range(numbers[0], numbers[-1] + 1, step)
    if len(whole) < 2 * len(numbers) and set(numbers) <= set(whole):
        return list(whole), []
    return numbers, ["frame numbers have no constant step: missing frames are not noticed"]


def _entries(path: Path) -> Iterator[tuple[float, str, Path]]:
    """Time, part and file of each entry of a .pvd or .series file."""
    try:
        if path.suffix.lower() == ".series":
            for entry in json.loads(path.read_text())["files"]:
                yield float(entry["time"]), "", path.parent / entry["name"]
        else:
            for data in ElementTree.parse(path).iter("DataSet"):
                part = data.get("name") or data.get("part") or "0"
                yield float(data.get("timestep", 0)), part, path.parent / data.attrib["file"]
    except (OSError, ValueError, KeyError, TypeError, ElementTree.ParseError) as error:
        raise BadInput(f"{path}: {type(error).__name__}: {error}") from None


def _blocks(path: Path) -> Iterator[tuple[str, Path]]:
    """Name and file of each block of a .vtm file."""
    try:
        for data in ElementTree.parse(path).iter("DataSet"):
            if file := data.get("file"):
                yield data.get("name") or f"block{data.get('index')}", path.parent / file
    except (OSError, ElementTree.ParseError) as error:
        raise BadInput(f"{path}: {error}") from None
