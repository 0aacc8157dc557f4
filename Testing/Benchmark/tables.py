#!/usr/bin/env python3
"""Writes the tables of a page from the CSV of palpate_race.

usage: tables.py FIGURES.csv PAGE.md

Each table stands in the page between the lines "<!-- table NAME -->" and "<!-- end -->". The script
replaces the lines between these two and leaves all others unchanged.
"""
import csv
import re
import sys


def figure(value):
    """Three significant digits."""
    value = float(value)
    if value == 0 or abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.{3 if abs(value) < 1 else 2 if abs(value) < 10 else 1}f}"


# The scenes of a page's tables; the CSV has all.
SHOWN = ("organs", "cloth", "sheets-64K", "sheets-1M", "twisted-rods", "rod-twist")


class Figures:
    def __init__(self, path):
        with open(path, newline="") as file:
            self.rows = list(csv.DictReader(file))

    def of(self, table):
        return [row for row in self.rows if row["table"] == table]

    def value(self, table, scene, threads, engine, metric):
        for row in self.of(table):
            key = (row["scene"], int(row["threads"]), row["engine"], row["metric"])
            if key == (scene, threads, engine, metric):
                return float(row["value"])
        return None

    def distinct(self, table, column):
        return list(dict.fromkeys(row[column] for row in self.of(table)))


def markdown(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def joined(figures, table, scene, engine, metric, suffix=""):
    """The figures of 1 and more threads, in one cell."""
    found = [figures.value(table, scene, threads, engine, metric) for threads in (1, 2)]
    return " / ".join(figure(value) + suffix for value in found if value is not None) or "-"


def race(figures):
    engines = [e for e in figures.distinct("race", "engine") if e != "scene" and "sorted" not in e]
    rows = [["triangles"] + [figure(figures.value("race", s, 1, "scene", "triangles")) for s in SHOWN]]
    rows.append(["pairs, median"] + [figure(figures.value("race", s, 1, "scene", "pairs")) for s in SHOWN])
    rows += [[e] + [joined(figures, "race", s, e, "median ms") for s in SHOWN] for e in engines]
    return markdown(["ms, 1 / 2 threads", *SHOWN], rows)


def metrics(table, first, scenes=None, engines=None, columns=None):
    """One row for each scene and engine, one column for each metric. Without lists: all of the table."""
    def write(figures):
        shown = columns or figures.distinct(table, "metric")
        rows = []
        for scene in figures.distinct(table, "scene"):
            for engine in dict.fromkeys(r["engine"] for r in figures.of(table) if r["scene"] == scene):
                if (scenes is None or scenes(scene)) and (engines is None or engines(engine)):
                    rows.append([f"{scene}, {engine}"] + [joined(figures, table, scene, engine, m) for m in shown])
        return markdown([first] + shown, rows)
    return write


def types(figures):
    """Frames of other geometry types, one row for each engine."""
    rows = [[f"{scene}, {engine}", joined(figures, table, scene, engine, metric)]
            for table, metric in (("lines", "frame ms"), ("points", "frame ms"), ("shapes", "pair ms"))
            for scene in figures.distinct(table, "scene") for engine in figures.distinct(table, "engine")
            if figures.value(table, scene, 1, engine, metric) is not None]
    return markdown(["1 / 2 threads", "ms"], rows)


# The queries of a page's table; the CSV has all.
QUERIES = ("triangles: closest near", "triangles: closest anywhere", "triangles: signed distance near",
           "triangles: contains", "triangles: first hit", "triangles: 8 nearest", "triangles: capsule",
           "points: closest near", "triangles: minimum distance")


def spatial(figures):
    """One row for each query: Palpate beside the fastest library at 100,000 elements, and the ratios of all sizes."""
    def fastest(scene):
        times = {r["engine"]: float(r["value"]) for r in figures.of("spatial")
                 if r["scene"] == scene and r["metric"] == "us"}
        own = times.pop("Palpate", None)
        return own, min(times, key=times.get, default=None), min(times.values(), default=None)

    rows = []
    for scene in figures.distinct("spatial", "scene"):
        own, engine, least = fastest(scene)
        if not scene.startswith("100K") or scene[5:] not in QUERIES or engine is None:
            continue
        ratios = []
        for size in ("10K", "100K", "1M"):
            mine, _, other = fastest(scene.replace("100K", size, 1))
            ratios += [mine / other] if mine and other else []
        rows.append([scene[5:], figure(own), engine, figure(least), f"{min(ratios):.2f} to {max(ratios):.2f}"])
    return markdown(["1 thread", "Palpate us", "fastest library", "its us", "ratio"], rows)


def particles(figures):
    """One row for each number of particles and of triangles: each method's frame."""
    methods = figures.distinct("particles", "engine")
    rows = [[f"{int(number):,}" for number in re.findall(r"\d+", scene)] +
            [figure(figures.value("particles", scene, 1, m, "frame ms")) for m in methods]
            for scene in figures.distinct("particles", "scene")]
    return markdown(["particles", "triangles", *(f"`{m}` ms" for m in methods)], rows)


# README's three figures: what is measured, its table, scene, metric and unit.
THREE = (
    ("five organs that glide through each other, {triangles} triangles: all pairs of triangles whose boxes overlap",
     "race", "organs", "median ms", "ms"),
    ("a twisted rod with itself, {triangles} triangles: likewise", "race", "rod-twist", "median ms", "ms"),
    ("nearest of 100,000 triangles to a point close to them", "spatial", "100K triangles: closest near", "us", "µs"),
)


def three(figures):
    """One row for each of README's figures: Palpate beside the fastest other library, on one thread."""
    rows = []
    for what, table, scene, metric, unit in THREE:
        times = {r["engine"]: float(r["value"]) for r in figures.of(table)
                 if r["scene"] == scene and r["metric"] == metric and int(r["threads"]) == 1}
        own = times["Palpate"]
        peer = min((engine for engine in times if not engine.startswith("Palpate")), key=times.get)
        triangles = figures.value(table, scene, 1, "scene", "triangles")
        what = what.format(triangles=f"{triangles:,.0f}" if triangles else "")
        rows.append([what, f"{figure(own)} {unit}", f"{figure(times[peer])} {unit}, {peer}"])
    return markdown(["one thread", "Palpate", "fastest other library"], rows)


def provenance(figures):
    row = figures.rows[0]
    return [f"{row['machine']}, {row['compiler']}, SIMD path {row['simd']}, commit {row['commit']}."]


TABLES = {
    "provenance": provenance,
    "race": race,
    "three": three,
    "whole-frame": metrics("whole frame", "1 / 2 threads"),
    "continuous": metrics("continuous", "1 / 2 threads", engines=lambda e: not e.startswith("Embree"),
                          columns=["ms", "narrow phase ms"]),
    "resting": metrics("resting", "1 thread", columns=["Proximity ms", "Auto ms"]),
    "particles": particles,
    "fields": metrics("fields", "1 thread", scenes=lambda s: s.startswith(("sphere", "liver", "bone")) and
                      s.endswith((" 1 %, band 3 %", " 0.1 %, band 0.3 %"))),
    "spatial": spatial,
    "types": types,
    "options": metrics("options", "1 thread"),
    "cuts": metrics("cuts", "1 thread"),
    "free-motion": metrics("free motion", "1 thread", columns=["Continuous ms", "with free motion ms"]),
    "kept": metrics("kept pairs", "1 / 2 threads", columns=["searched ms", "kept ms"]),
    "simplify": metrics("simplify", "1 thread"),
    "inside": metrics("inside", "1 / 2 threads", scenes=lambda s: s != "around"),
}


def main(figures_path, page_path):
    figures = Figures(figures_path)
    with open(page_path) as file:
        page = file.read()

    def table(match):
        lines = TABLES[match[1]](figures)
        return f"<!-- table {match[1]} -->\n" + "\n".join(lines) + "\n<!-- end -->"

    page = re.sub(r"<!-- table (\S+) -->\n.*?<!-- end -->", table, page, flags=re.DOTALL)
    with open(page_path, "w") as file:
        file.write(page)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
