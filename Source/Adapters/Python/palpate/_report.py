"""The report of a check: tables, and an HTML page that needs no network."""

import csv
import html
import json
import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

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


ROWS_ON_THE_PAGE = 1000


def page_of(
    summary: Summary,
    sequence: Sequence,
    notes: Iterable[str],
    pictures: Iterable[Picture],
    captures: dict[tuple[int, str, str, str], Path],
    replay: dict[str, Any],
) -> str:
    """The HTML page. Paths of captures are relative to it. replay: of replay_of()."""
    counts = summary.counts
    parts = []
    if counts:
        parts.append('<table><tr><th>kind<th>findings<th class="text">meaning')
        for kind, text in KINDS.items():
            if counts[kind]:
                number = counts[kind]
                parts.append(f'<tr><td>{_key(kind)}{kind}<td>{number}<td class="text">{text}')
        parts.append("</table>")
        shown = list(pictures)
        if shown:
            parts.append("<h2>Worst findings</h2>")
        for picture in shown:
            caption = html.escape(_caption(picture.finding))
            parts.append(f"<figure>{picture.markup}<figcaption>{caption}</figcaption></figure>")
        parts.append(_table(summary, captures))
    place = {number: at for at, number in enumerate(sequence.numbers)}
    series = {kind: [0] * len(place) for kind in KINDS if counts[kind]}
    for (frame, kind, *_), group in summary.groups.items():
        series[kind][place[frame]] += group.count
    data: dict[str, Any] = {
        "title": "palpate-check",
        "paragraphs": [
            f"{len(place)} frames. Bodies: {', '.join(b.name for b in sequence.bodies)}.",
            *(f"Note: {note}." for note in notes),
            *(() if counts else ("Nothing found.",)),
        ],
        "frames": sequence.numbers,
        "series": [{"name": kind, "values": values} for kind, values in series.items()],
    }
    for each in data["series"]:
        if each["name"] not in NO_FAULTS:
            each["budget"] = 0
    if sequence.times:
        data["times"] = [sequence.times.get(number) for number in sequence.numbers]
    worst = summary.worst(1)
    if worst:
        data["worst"] = {"at": place[worst[0].frame], "text": worst[0].kind}
    if replay["frames"]:
        data["replay"] = replay
    else:
        data["paragraphs"] += replay["notes"]
    page = (resources.files("palpate") / "_report.html").read_text(encoding="utf-8")
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    body, script = page.split("{{body}}")
    return "\n".join([body, *parts, script.replace("{{data}}", text)])


def _caption(finding: Finding) -> str:
    frame, kind, bodies, _, depth, time, elements = _cells(Group(1, finding, finding.depth))
    text = f"Frame {frame}, {kind}, {bodies}: {elements}"
    if depth:
        text += f", depth {depth}"
    return text + (f", drawn at {time} of the step" if time else "")


def _key(kind: str) -> str:
    return f'<span class="k" style="background:{COLOURS[kind]}"></span>'


def _table(summary: Summary, captures: dict[tuple[int, str, str, str], Path]) -> str:
    rows = ['<h2>Frames</h2><table><tr><th>frame<th class="text">kind<th class="text">bodies']
    rows[0] += '<th>findings<th>depth<th>time<th class="text">worst<th class="text">capture'
    groups = list(summary.groups.values())
    for group in groups[:ROWS_ON_THE_PAGE]:
        cells = [html.escape(cell) for cell in _cells(group)]
        frame, kind, bodies, count, depth, time, worst = cells
        path = captures.get(group.worst.group)
        link = f'<a href="{html.escape(path.as_posix())}">capture</a>' if path else ""
        rows.append(
            f'<tr><td>{frame}<td class="text">{_key(group.worst.kind)}{kind}'
            f'<td class="text">{bodies}<td>{count}<td>{depth}<td>{time}<td class="text">{worst}<td class="text">{link}'
        )
    rows.append("</table>")
    if len(groups) > ROWS_ON_THE_PAGE:
        rows.append(f"<p>{len(groups) - ROWS_ON_THE_PAGE} more rows are in report.txt.</p>")
    return "\n".join(rows)
