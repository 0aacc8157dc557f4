"""The report of a check: tables, and an HTML page that needs no network."""

import csv
import html
import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from palpate._findings import INSIDE, KINDS, Finding
from palpate._sequence import Sequence

NO_FAULTS = ("touch",)
COLOURS = {
    "penetration": "#c0392b",
    "crossing": "#e67e22",
    "self-intersection": "#8e44ad",
    "self-crossing": "#2980b9",
    "inverted": "#16a085",
    "topology": "#7f8c8d",
    "touch": "#bdc3c7",
    "unreadable": "#2c3e50",
}


@dataclass
class Group:
    """The findings of one kind between two bodies in one frame.

    worst  the deepest finding; the earliest, if none has a depth. Surfaces that pierce each other
           come before vertices inside, because two elements show them.
    depth  L: of the deepest finding; NaN: none has a depth
    """

    count: int
    worst: Finding
    depth: float

    def add(self, finding: Finding) -> None:
        self.count += 1
        if not self.depth >= finding.depth:  # or either is NaN
            self.depth = self.depth if math.isnan(finding.depth) else finding.depth
        if _order(finding) < _order(self.worst):
            self.worst = finding


class Picture(NamedTuple):
    """A drawing of a finding: SVG, or an image for the page."""

    finding: Finding
    markup: str


def _order(finding: Finding) -> tuple[bool, float, float]:
    depth = 0.0 if math.isnan(finding.depth) else finding.depth
    return finding.text == INSIDE, -depth, 2.0 if math.isnan(finding.time) else finding.time


class Summary:
    """Groups of findings. Memory grows with the frames that have findings only."""

    def __init__(self) -> None:
        self.groups: dict[tuple[int, str, str, str], Group] = {}
        self.counts: Counter[str] = Counter()  # findings by kind

    def add(self, finding: Finding) -> None:
        self.counts[finding.kind] += 1
        group = self.groups.get(finding.group)
        if group is None:
            self.groups[finding.group] = Group(1, finding, finding.depth)
        else:
            group.add(finding)

    def worst(self, number: int) -> list[Finding]:
        """At most so many findings: the worst of each kind and pair, then the second worst."""
        rows: dict[tuple[str, str, str], list[Group]] = {}
        for (_, kind, a, b), group in self.groups.items():
            if kind not in (*NO_FAULTS, "topology", "unreadable"):
                rows.setdefault((kind, a, b), []).append(group)
        ranked = []
        for groups in rows.values():
            groups.sort(key=lambda group: (_order(group.worst), -group.count, group.worst.frame))
            ranked += [(place, _order(g.worst), g.worst) for place, g in enumerate(groups)]
        ranked.sort(key=lambda row: row[:2])
        return [finding for *_, finding in ranked[:number]]


class FindingsTable:
    """findings.csv, one row for each finding."""

    def __init__(self, path: Path, sequence: Sequence) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._times = sequence.times
        self._writer = csv.writer(self._file)
        times = ["time"] if sequence.times else []
        names = {"time": "time_of_impact"}
        self._writer.writerow([*times, *(names.get(name, name) for name in Finding._fields)])

    def add(self, finding: Finding) -> None:
        row = ["" if isinstance(v, float) and math.isnan(v) else v for v in finding]
        self._writer.writerow([self._times.get(finding.frame, ""), *row] if self._times else row)

    def close(self) -> None:
        self._file.close()


def text_of(summary: Summary, sequence: Sequence, notes: Iterable[str], limit: int = 0) -> str:
    """The report as text. limit: the number of groups; 0: all."""
    counts = summary.counts
    lines = [
        f"{len(sequence.numbers)} frames, bodies: "
        + ", ".join(body.name for body in sequence.bodies)
    ]
    lines += [f"note: {note}" for note in notes]
    lines += [f"{counts[kind]:8} {kind}: {text}" for kind, text in KINDS.items() if counts[kind]]
    if not counts:
        lines.append("nothing found")
        return "\n".join(lines) + "\n"
    rows: list[tuple[str, ...]] = [
        ("frame", "kind", "bodies", "findings", "depth", "time", "worst")
    ]
    groups = list(summary.groups.values())
    rows += [_cells(group) for group in (groups[:limit] if limit else groups)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines.append("")
    for row in rows:
        lines.append("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip())
    if limit and len(groups) > limit:
        lines.append(f"... and {len(groups) - limit} more rows in report.txt")
    return "\n".join(lines) + "\n"


def _cells(group: Group) -> tuple[str, ...]:
    worst = group.worst
    bodies = ", ".join(dict.fromkeys(name for name in (worst.body_a, worst.body_b) if name))
    elements = ", ".join(e for e in (worst.element_a, worst.element_b) if e)
    return (
        str(worst.frame),
        worst.kind,
        bodies,
        str(group.count),
        "" if math.isnan(group.depth) else f"{group.depth:.6g}",
        "" if math.isnan(worst.time) else f"{worst.time:.6f}",
        elements or worst.text,
    )


STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 70em; color: #222 }
table { border-collapse: collapse; margin: 1em 0 }
th, td { padding: 0.2em 0.9em; text-align: left; border-bottom: 1px solid #ddd }
td.n { text-align: right; font-variant-numeric: tabular-nums }
figure { display: inline-block; margin: 0 1em 1em 0; vertical-align: top }
figcaption { max-width: 30em; font-size: 13px }
.k { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.4em }
"""
ROWS_ON_THE_PAGE = 1000


def page_of(
    summary: Summary,
    sequence: Sequence,
    notes: Iterable[str],
    pictures: Iterable[Picture],
    captures: dict[tuple[int, str, str, str], Path],
) -> str:
    """The HTML page. Paths of captures are relative to it."""
    counts = summary.counts
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>palpate-check</title>',
        f"<style>{STYLE}</style><h1>palpate-check</h1>",
        f"<p>{len(sequence.numbers)} frames. Bodies: ",
        ", ".join(html.escape(body.name) for body in sequence.bodies) + ".</p>",
    ]
    parts += [f"<p>Note: {html.escape(note)}.</p>" for note in notes]
    if not counts:
        parts.append("<p>Nothing found.</p>")
    else:
        parts.append("<table><tr><th>kind<th>findings<th>meaning")
        for kind, text in KINDS.items():
            if counts[kind]:
                parts.append(f'<tr><td>{_key(kind)}{kind}<td class="n">{counts[kind]}<td>{text}')
        parts.append("</table>")
        parts.append("<h2>Timeline</h2>" + timeline(summary, sequence))
        shown = list(pictures)
        if shown:
            parts.append("<h2>Worst findings</h2>")
        for picture in shown:
            caption = html.escape(_caption(picture.finding))
            parts.append(f"<figure>{picture.markup}<figcaption>{caption}</figcaption></figure>")
        parts.append(_table(summary, captures))
    return "\n".join(parts) + "\n</html>\n"


def _caption(finding: Finding) -> str:
    frame, kind, bodies, _, depth, time, elements = _cells(Group(1, finding, finding.depth))
    text = f"Frame {frame}, {kind}, {bodies}: {elements}"
    if depth:
        text += f", depth {depth}"
    return text + (f", drawn at {time} of the step" if time else "")


def _key(kind: str) -> str:
    return f'<span class="k" style="background:{COLOURS[kind]}"></span>'


def _table(summary: Summary, captures: dict[tuple[int, str, str, str], Path]) -> str:
    rows = ["<h2>Frames</h2><table><tr><th>frame<th>kind<th>bodies<th>findings<th>depth<th>time"]
    rows[0] += "<th>worst<th>capture"
    groups = list(summary.groups.values())
    for group in groups[:ROWS_ON_THE_PAGE]:
        cells = [html.escape(cell) for cell in _cells(group)]
        frame, kind, bodies, count, depth, time, worst = cells
        path = captures.get(group.worst.group)
        link = f'<a href="{html.escape(path.as_posix())}">capture</a>' if path else ""
        rows.append(
            f'<tr><td class="n">{frame}<td>{_key(group.worst.kind)}{kind}<td>{bodies}'
            f'<td class="n">{count}<td class="n">{depth}<td class="n">{time}<td>{worst}<td>{link}'
        )
    rows.append("</table>")
    if len(groups) > ROWS_ON_THE_PAGE:
        rows.append(f"<p>{len(groups) - ROWS_ON_THE_PAGE} more rows are in report.txt.</p>")
    return "\n".join(rows)


def timeline(summary: Summary, sequence: Sequence) -> str:
    """An SVG with a row for each kind: where the frames with findings are, and how many."""
    kinds = [kind for kind in KINDS if summary.counts[kind]]
    place = {number: i for i, number in enumerate(sequence.numbers)}
    bins = min(len(sequence.numbers), 400)
    left, width, height = 130, 800, 26
    most: dict[tuple[str, int], int] = {}
    for (frame, kind, *_), group in summary.groups.items():
        bar_at = (kind, place[frame] * bins // len(sequence.numbers))
        most[bar_at] = most.get(bar_at, 0) + group.count
    top = math.log1p(max(most.values()))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + width + 20}" '
        f'height="{height * len(kinds) + 30}" font-size="12" font-family="sans-serif">'
    ]
    for row, kind in enumerate(kinds):
        base = (row + 1) * height
        parts.append(f'<text x="0" y="{base - 6}">{kind}</text>')
        parts.append(f'<path d="M{left} {base}h{width}" stroke="#ccc"/>')
        for at in range(bins):
            if count := most.get((kind, at), 0):
                bar = 4 + (height - 8) * math.log1p(count) / top
                first = sequence.numbers[-(-at * len(sequence.numbers) // bins)]
                parts.append(
                    f'<rect x="{left + at * width / bins:.1f}" y="{base - bar:.1f}" '
                    f'width="{max(width / bins, 1.5):.1f}" height="{bar:.1f}" '
                    f'fill="{COLOURS[kind]}"><title>frame {first}: {count}</title></rect>'
                )
    base, last = height * len(kinds) + 18, sequence.numbers[-1]
    parts.append(f'<text x="{left}" y="{base}">frame {sequence.numbers[0]}</text>')
    parts.append(f'<text x="{left + width}" y="{base}" text-anchor="end">{last}</text></svg>')
    return "".join(parts)
