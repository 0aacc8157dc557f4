#!/usr/bin/python3
"""Draws speed against accuracy at a rigid body: rigidBodies.py CSV PICTURE writes PICTURE.svg.

The CSV is the rigid-bodies.csv of Examples/SpeedAccuracy.
"""
import sys

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from chartStyle import COLOUR, MARK, distinct, plt, read, save

EXACT = 1e-4  # % of the diagonal; smaller errors are drawn here
CAPTION = """\
A tool, a deforming organ and particles at a generated bone of a million triangles. Marks: the largest error of a distance that was seen.
Bars end at the error that the method states. Below and left is better. Proximity tests triangles, and its error is rounding."""


def main(source, picture):
    rows = read(source)
    scenes = distinct(row["scene"] for row in rows)
    figure, grid = plt.subplots(1, len(scenes), figsize=(10, 4.6), sharey=True, squeeze=False)
    figure.subplots_adjust(left=0.085, right=0.985, top=0.74, bottom=0.13, wspace=0.08)
    for axes, scene in zip(grid[0], scenes):
        axes.set_title(scene, loc="left")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.grid(True)
        axes.set_axisbelow(True)
        axes.set_xlabel("time (ms a frame, one thread)")
        times = [row["ms"] for row in rows if row["scene"] == scene]
        axes.set_xlim(min(times) / 1.8, max(times) * 2.2)
        axes.xaxis.set_major_locator(FixedLocator([0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        for method in distinct(row["method"] for row in rows):
            own = [row for row in rows if row["scene"] == scene and row["method"] == method]
            for row in own:
                row["seen"] = max(row["distance_worst"], EXACT)
                if row["stated"] > 0:
                    axes.plot([row["ms"]] * 2, [row["seen"], row["stated"]], color=COLOUR[method], linewidth=1, alpha=0.6)
                    axes.plot([row["ms"]], [row["stated"]], "_", color=COLOUR[method], markersize=8)
                    share = row["setting"].split(" of ")[0]
                    axes.annotate(share, (row["ms"], row["stated"]), xytext=(4, 3), textcoords="offset points", fontsize=7,
                                  color=COLOUR[method])
            if own:
                axes.plot([row["ms"] for row in own], [row["seen"] for row in own], MARK[method], color=COLOUR[method], markersize=7,
                          markeredgecolor="white", markeredgewidth=0.6, linestyle="-", linewidth=0.8, label=method)
        axes.legend(loc="lower left", fontsize=8, frameon=False)
    grid[0][0].set_ylabel("error of distances (% of the diagonal)")
    grid[0][0].yaxis.set_major_formatter(FuncFormatter(lambda v, _: "0" if v <= EXACT else f"{v:g}"))
    figure.text(0.012, 0.985, "Speed against accuracy at a rigid body", fontsize=13, fontweight="bold", va="top")
    figure.text(0.012, 0.915, CAPTION, fontsize=8, va="top", linespacing=1.35)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
