#!/usr/bin/python3
"""Draws build time and memory of distance fields: distanceFields.py CSV PICTURE writes PICTURE.svg.

The CSV is that of palpate_race --tables fields. The rows with a band of three bounds are drawn.
"""
import re
import sys

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from chartStyle import BLACK, VERMILLION, plt, read, save

PANELS = (("build ms", "build time (ms of one thread)"), ("MB", "memory (MB)"))
COLOUR = {"Palpate": VERMILLION, "OpenVDB 10": BLACK}
MARKS = "osD^v"
CAPTION = """\
Distance fields in a band of three error bounds, for each body. The bound is a share
of the diagonal of the body's box. OpenVDB's voxels are as large as the bound.
Its error is not bounded by proof. Both axes are logarithmic."""


def seriesOf(rows, engine, metric):
    """Points (bound, value) of each body, in percent, from the largest bound on."""
    series = {}
    for row in rows:
        body, bound, band = re.fullmatch(r"(.*), ([\d.]+) %, band ([\d.]+) %", row["scene"]).groups()
        if row["engine"] == engine and row["metric"] == metric and row["threads"] == 1 and abs(float(band) / float(bound) - 3) < 1e-6:
            series.setdefault(body, []).append((float(bound), row["value"]))
    return {body: sorted(points, reverse=True) for body, points in series.items() if len(points) > 1}


def main(source, picture):
    rows = [row for row in read(source) if row["table"] == "fields"]
    figure, grid = plt.subplots(1, 2, figsize=(10, 4.6))
    figure.subplots_adjust(left=0.07, right=0.985, top=0.74, bottom=0.12, wspace=0.2)
    for axes, (metric, title) in zip(grid, PANELS):
        for engine in COLOUR:  # not those of equal error
            for mark, (body, points) in zip(MARKS, seriesOf(rows, engine, metric).items()):
                axes.plot(*zip(*points), color=COLOUR[engine], marker=mark, markersize=5.5, linewidth=1.3, label=f"{engine}, {body}")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.invert_xaxis()
        axes.xaxis.set_major_locator(FixedLocator([1, 0.3, 0.1]))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g} %"))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axes.set_xlabel("error bound")
        axes.set_title(title, loc="left")
        axes.grid(True)
        axes.set_axisbelow(True)
    figure.text(0.012, 0.985, "Distance fields: cost against the error bound", fontsize=13, fontweight="bold", va="top")
    figure.text(0.012, 0.925, CAPTION, fontsize=8, va="top", linespacing=1.35)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=7.5, loc="upper right", bbox_to_anchor=(0.99, 0.995), frameon=False, ncol=2)
    save(figure, picture)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
