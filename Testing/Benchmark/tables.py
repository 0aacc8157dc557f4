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
    scenes = figures.distinct("race", "scene")
    engines = [engine for engine in figures.distinct("race", "engine") if engine != "scene"]
    header = ["ms, 1 / 2 threads"] + scenes
    rows = [["triangles"] + [figure(figures.value("race", s, 1, "scene", "triangles")) for s in scenes]]
    rows.append(["pairs, median"] + [figure(figures.value("race", s, 1, "scene", "pairs")) for s in scenes])
    rows += [[e] + [joined(figures, "race", s, e, "median ms") for s in scenes] for e in engines]
    return markdown(header, rows)


def sets(figures):
    header = ["false negatives, false positives, in four frames"] + figures.distinct("race", "scene")
    rows = []
    for engine in figures.distinct("race", "engine"):
        if engine == "scene":
            continue
        cells = []
        for scene in header[1:]:
            negatives, positives = (figures.value("race", scene, 1, engine, m) for m in ("false negatives", "false positives"))
            cells.append("-" if negatives is None else f"{negatives:.0f}, {positives:.0f}")
        rows.append([engine] + cells)
    return markdown(header, rows)


def comparison(figures):
    scenes = figures.distinct("comparison", "scene")
    rows = []
    for what in figures.distinct("comparison", "engine"):
        cells = []
        for scene in scenes:
            target = figures.value("comparison", scene, 1, what, "target")
            ratios = joined(figures, "comparison", scene, what, "ratio")
            cells.append("-" if target is None else f"{ratios} of {target:g}")
        rows.append([what] + cells)
    return markdown(["speed-up, 1 / 2 threads, of the target"] + scenes, rows)


def metrics(table, first):
    """One row for each scene and engine, one column for each metric."""
    def write(figures):
        columns = figures.distinct(table, "metric")
        rows = []
        for scene in figures.distinct(table, "scene"):
            for engine in dict.fromkeys(r["engine"] for r in figures.of(table) if r["scene"] == scene):
                rows.append([f"{scene}, {engine}"] + [joined(figures, table, scene, engine, m) for m in columns])
        return markdown([first] + columns, rows)
    return write


def cell(value):
    return "-" if value is None else figure(value)


def verdict(value, limit):
    return "-" if value is None or limit is None else "met" if value <= limit else "NOT MET"


def spatial(figures):
    """One row for each query: Palpate beside the fastest library."""
    rows = []
    for scene in figures.distinct("spatial", "scene"):
        times = {r["engine"]: float(r["value"]) for r in figures.of("spatial")
                 if r["scene"] == scene and r["metric"] == "us"}
        own = times.pop("Palpate", None)
        if not times:
            continue
        fastest = min(times, key=times.get)
        update = figures.value("spatial", scene, 1, fastest, "update ms")
        if update is None:
            update = figures.value("spatial", scene.split(":")[0] + ": update", 1, fastest, "ms")
        row = [scene, cell(own), fastest, cell(times[fastest]), cell(update)]
        ratio, allowed, target = (figures.value("spatial", scene, 1, "Palpate", metric) for metric in
                                  ("ratio to the fastest library", "allowed ratio", "scaled target us"))
        row += [cell(ratio), cell(allowed), verdict(ratio, allowed), cell(target), verdict(own, target)]
        rows.append(row)
    return markdown(["1 thread", "Palpate us", "fastest library", "its us", "its update ms", "ratio", "allowed ratio",
                     "verdict", "scaled target us", "verdict"], rows)


def by_engine(table, cell):
    """One row for each scene, one column for each engine."""
    def write(figures):
        engines = figures.distinct(table, "engine")
        rows = [[scene] + [cell(figures, scene, engine) for engine in engines]
                for scene in figures.distinct(table, "scene")]
        return markdown(["1 thread"] + engines, rows)
    return write


def coarse(figures):
    """One row for each scene: the frames with each mesh, and what the simplification decides."""
    engines = figures.distinct("coarse", "engine")
    counts = ["frames decided", "contacts", "contacts lost"]
    rows = [[scene] + [joined(figures, "coarse", scene, engine, "frame ms") for engine in engines] +
            [cell(figures.value("coarse", scene, 1, engines[-1], count)) for count in counts]
            for scene in figures.distinct("coarse", "scene")]
    return markdown(["1 thread"] + [engine + ", ms" for engine in engines] + counts, rows)


def spatial_time(figures, scene, engine):
    metric = "ms" if scene.endswith("update") else "us"
    return joined(figures, "spatial", scene, engine, metric)


def spatial_error(figures, scene, engine):
    wrong, widest = (figures.value("spatial errors", scene, 1, engine, m) for m in ("wrong", "largest error / diagonal"))
    if wrong is None:
        return "-"
    return f"{wrong:.0f}" + (f", {widest:.0e}" if widest else "")


def provenance(figures):
    row = figures.rows[0]
    return [f"{row['machine']}, {row['compiler']}, SIMD path {row['simd']}, commit {row['commit']}."]


TABLES = {
    "provenance": provenance,
    "race": race,
    "sets": sets,
    "comparison": comparison,
    "stages": metrics("stages", "1 / 2 threads"),
    "whole-frame": metrics("whole frame", "1 / 2 threads"),
    "far-triangle": metrics("far triangle", "1 thread"),
    "at-rest": metrics("at rest", "1 thread"),
    "small-tool": metrics("small tool", "1 thread"),
    "scale": metrics("scale", "1 / 2 threads"),
    "steady": metrics("steady frames", "1 / 2 threads"),
    "features": metrics("features", "1 thread"),
    "continuous": metrics("continuous", "1 / 2 threads"),
    "validity": metrics("validity", "1 thread"),
    "resting": metrics("resting", "1 thread"),
    "aligned": metrics("aligned", "1 thread"),
    "queries": metrics("queries", "1 thread"),
    "fields": metrics("fields", "1 thread"),
    "spatial": spatial,
    "spatial-times": by_engine("spatial", spatial_time),
    "spatial-errors": by_engine("spatial errors", spatial_error),
    "spatial-batches": metrics("spatial batches", "1 / 2 threads"),
    "simd": metrics("simd", "1 thread"),
    "lines": metrics("lines", "1 / 2 threads"),
    "points": metrics("points", "1 / 2 threads"),
    "shapes": metrics("shapes", "1 thread"),
    "rigid": metrics("rigid", "1 / 2 threads"),
    "proxy": metrics("proxy", "1 / 2 threads"),
    "simplify": metrics("simplify", "1 thread"),
    "coarse": coarse,
    "bounds": metrics("bounds", "1 thread"),
    "inside": metrics("inside", "1 / 2 threads"),
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
