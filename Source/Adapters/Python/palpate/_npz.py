"""NPZ files with the frames of bodies. One frame of an array is in memory at a time."""

import contextlib
import os
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from palpate._errors import BadInput
from palpate._results import FloatArray

# Names of arrays in an NPZ file, the element type of each, and the vertices of an element.
POSITIONS = ("positions", "vertices")
ELEMENTS = {
    "tetrahedra": ("tetrahedron", 4),
    "triangles": ("triangle", 3),
    "faces": ("triangle", 3),
    "segments": ("segment", 2),
}


def _header(stream: IO[bytes], name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the array that a stream of an NPZ file has next."""
    version = np.lib.format.read_magic(stream)  # type: ignore[no-untyped-call]
    read: Any = (
        np.lib.format.read_array_header_1_0
        if version == (1, 0)
        else np.lib.format.read_array_header_2_0
    )
    shape, fortran, dtype = read(stream)
    if dtype.kind not in "fiu" or (fortran and len(shape) > 1):
        raise BadInput(f"{name}: save it as a C-contiguous array of numbers, not {dtype}")
    return shape, dtype


def bodies_of_npz(path: Path) -> list[tuple[str, tuple[int, ...]]]:
    """What precedes `positions` in the names of arrays, and the shape of the positions."""
    bodies = []
    with opened(path) as archive:
        for member in archive.namelist():
            body, _, name = member.removesuffix(".npy").rpartition(".")
            if name not in POSITIONS:
                continue
            with archive.open(member) as stream:
                shape, _ = _header(stream, f"{path}, {name}")
            if len(shape) not in (2, 3) or shape[-1] != 3:
                wanted = "(n, 3) or (frames, n, 3)"
                raise BadInput(f"{path}, {name}: shape {shape}; it must be {wanted}")
            bodies.append((f"{body}." if body else "", shape))
    if not bodies:
        raise BadInput(f'{path}: no array "positions" or "vertices"')
    return bodies


@contextlib.contextmanager
def opened(path: Path | str) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, ValueError) as error:
        raise BadInput(f"{path}: {error}") from None


class NpzRows:
    """Rows of an array (frames, n, 3) in an NPZ file, one at a time."""

    def __init__(self, path: str, body: str) -> None:
        self.path = path
        with opened(path) as archive:
            self._name = name_of_positions(archive, body)
        self._open()

    def _open(self) -> None:
        self._stream = zipfile.ZipFile(self.path).open(f"{self._name}.npy")
        self._shape, self._dtype = _header(self._stream, f"{self.path}, {self._name}")
        self._next = 0

    def row(self, row: int) -> FloatArray:
        if row < self._next:
            self._open()
        size = int(np.prod(self._shape[1:])) * self._dtype.itemsize
        try:
            self._stream.seek((row - self._next) * size, os.SEEK_CUR)
            data = self._stream.read(size)
        except (OSError, zipfile.BadZipFile, zlib.error, EOFError) as error:
            raise BadInput(f"{self.path}, row {row}: {error}") from None
        if len(data) != size:
            raise BadInput(f"{self.path}, row {row}: the file ends in it")
        self._next = row + 1
        values = np.frombuffer(data, self._dtype).reshape(self._shape[1:])
        return values.astype(np.float64)


def name_of_positions(archive: zipfile.ZipFile, body: str) -> str:
    names = archive.namelist()
    return next(body + name for name in POSITIONS if f"{body}{name}.npy" in names)


def array_of(archive: zipfile.ZipFile, path: str, name: str) -> Any:
    with archive.open(f"{name}.npy") as stream:
        _header(stream, f"{path}, {name}")  # refuses objects
    with archive.open(f"{name}.npy") as stream:
        array = np.lib.format.read_array(stream)  # type: ignore[no-untyped-call]
    return array.astype(np.float64) if name.rpartition(".")[2] in POSITIONS else array
