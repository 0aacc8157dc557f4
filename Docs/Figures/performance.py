#!/usr/bin/python3
"""Draws how long other libraries take beside Palpate: performance.py CSV FOLDER writes Race.svg and SpatialQueries.svg.

The CSV is the Performance.csv of Testing/Benchmark. Both charts have ratios of times of one run on one thread.
"""
import sys

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from chartStyle import BLACK, BLUE, GREEN, SKY, VERMILLION, distinct, plt, read, save

SCENES = ["organs", "cloth", "sheets-64K", "sheets-1M", "twisted-rods", "rod-twist"]  # those of the table
LOOKS = {"Embree": ("s", BLUE), "Bullet": ("^", GREEN), "FCL": ("X", BLACK), "CGAL": ("v", SKY), "nanoflann": ("D", GREEN)}


def timesOf(rows, table, metric):
    """Times of each scene and engine, in the unit of the metric."""
    times = {}
    for row in rows:
        if row["table"] == table and row["threads"] == 1 and row["metric"] == metric and row["engine"] != "scene":
            times.setdefault(row["scene"], {})[row["engine"]] = row["value"]
    return times


def prepare(names, title, sentence, ticks):
    """A chart with a row for each name, and the line at which Palpate is as fast."""
    height = 1.25 + 0.36 * len(names)
    figure, axes = plt.subplots(figsize=(8.3, height))
    figure.subplots_adjust(left=0.29, right=0.97, top=1 - 0.85 / height, bottom=0.45 / height)
    figure.text(0.012, 1 - 0.1 / height, title, fontsize=12, fontweight="bold", va="top")
    figure.text(0.012, 1 - 0.36 / height, sentence, fontsize=9, va="top")
    axes.set_xscale("log")
    axes.set_xlim(ticks[0] / 1.1, ticks[-1] * 1.1)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}×"))
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_yticks(range(len(names)), names, fontsize=9)
    axes.tick_params(axis="y", length=0)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.axvline(1, color=VERMILLION, linewidth=2.5)
    return figure, axes


def key(axes, libraries):
    for library in libraries:
        mark, colour = LOOKS[library]
        axes.plot([], [], mark, color=colour, label=library)
    axes.plot([], [], color=VERMILLION, linewidth=2.5, label="Palpate")
    axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 0.99), ncol=len(libraries) + 1, frameon=False, fontsize=9, handletextpad=0.3,
                columnspacing=1.2, borderaxespad=0)


def drawRace(rows, folder):
    times = timesOf(rows, "race", "median ms")
    figure, axes = prepare(SCENES, "Pairs of triangles whose boxes overlap",
                           "Time of the fastest variant of each library over that of Palpate. One thread, from positions to pairs.",
                           [1, 2, 5, 10, 20, 50, 100, 200])
    libraries = distinct(engine.split()[0] for engine in times[SCENES[0]] if not engine.startswith("Palpate"))
    for y, scene in enumerate(SCENES):
        for library in libraries:
            least = min(time for engine, time in times[scene].items() if engine.startswith(library))
            mark, colour = LOOKS[library]
            axes.plot([least / times[scene]["Palpate"]], [y], mark, color=colour, markersize=9, markeredgecolor="white")
    key(axes, libraries)
    save(figure, f"{folder}/Race")


def drawQueries(rows, folder):
    """A bar from the smallest to the largest ratio of 10 thousand, 100 thousand and a million elements, with the fastest library."""
    ratios = {}
    for scene, times in timesOf(rows, "spatial", "us").items():
        others = {engine: time for engine, time in times.items() if not engine.startswith("Palpate")}
        if not others:
            continue
        engine = min(others, key=others.get)
        ratios.setdefault(scene.split(" ", 1)[1].replace("minimum distance", "min. distance"), []).append((others[engine] / times["Palpate"], engine.split()[0]))
    figure, axes = prepare(list(ratios), "Spatial queries",
                           "Time of the fastest library over that of Palpate, for 10,000 to a million elements. One thread.",
                           [0.2, 0.5, 1, 2, 5, 10, 20, 50])
    for y, values in enumerate(ratios.values()):
        axes.plot([min(values)[0], max(values)[0]], [y, y], color="#999999", linewidth=1.5)
        for value, library in values:
            mark, colour = LOOKS[library]
            axes.plot([value], [y], mark, color=colour, markersize=8, markeredgecolor="white")
    key(axes, distinct(library for values in ratios.values() for _, library in values))
    save(figure, f"{folder}/SpatialQueries")


def main(source, folder):
    rows = read(source)
    drawRace(rows, folder)
    drawQueries(rows, folder)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
