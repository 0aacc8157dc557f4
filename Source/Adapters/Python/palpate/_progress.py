"""Progress of a long command: a bar on a terminal, now and then a line elsewhere."""

import sys
import time

BETWEEN_LINES = 30.0  # seconds


class Progress:
    """Prints to stderr. Call it with what is done, of how many, and a short text."""

    def __init__(self, name: str, quiet: bool = False) -> None:
        self._name, self._quiet = name, quiet
        self._terminal = sys.stderr.isatty()
        self._start = self._last = time.monotonic()

    def __call__(self, done: int, total: int, text: str = "") -> None:
        now = time.monotonic()
        wait = 0.1 if self._terminal else BETWEEN_LINES
        if self._quiet or (done < total and now - self._last < wait):
            return
        self._last = now
        line = f"{self._name}: {done} of {total}, {now - self._start:.0f} s"
        if text:
            line += f", {text}"
        if self._terminal:
            filled = 30 * done // max(total, 1)
            end = "\n" if done >= total else ""
            line = f"\r[{'#' * filled}{'.' * (30 - filled)}] {line}\x1b[K{end}"
        else:
            line += "\n"
        sys.stderr.write(line)
        sys.stderr.flush()
