#!/usr/bin/python3
"""Draws where each method starts to fail: stability.py CSV PICTURE writes PICTURE.svg and PICTURE.png.

The CSV is the stability.csv of Testing/Stability, whose rows go from the easiest to the most difficult value of a sweep.
"""
import sys
from math import ceil, floor, log10

from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from chartStyle import COLOUR, MARK, distinct, placeLabels, plt, read, save

CAPTION = """\
Each sweep makes one property of two meeting triangles more difficult, to the right. Each curve is the share of the cases with an error. Two names at one curve share it.
The number at a name is the difficulty at which the error first occurs. Dashed: false positives; all other curves on the left: false negatives.
Orange: the recommended methods. Methods without a curve have no such error in the sweep. {none}"""
RECOMMENDED = ("Auto", "Auto: distinct", "Continuous")
# Columns of the CSV with their line styles, title, and the sentence of a panel without errors.
PANELS = [({"false_negatives": "-", "false_positives": (0, (4, 2))}, "False negatives and false positives (% of cases)",
           "No method has a false negative or a false positive."),
          ({"wrong_side": "-"}, "Normals on the wrong side (% of cases)", "No method has a normal on the wrong side.")]
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# What a label says of a column beside the method.
SAYS = {"false_negatives": "", "false_positives": ", false positives", "wrong_side": ""}


def number(value):
    """Two digits; powers of ten where these are shorter."""
    if 1e-3 <= value < 1e5:
        return f"{value:.2g}" if value < 10 else f"{value:.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    mantissa = mantissa.removesuffix(".0")
    return ("" if mantissa == "1" else mantissa + "×") + "10" + str(int(exponent)).translate(SUPERSCRIPT)


def curvesOf(rows, columns):
    """Curves with an error, as (methods, column, points). Methods with the same onset and nearly the same curve share one."""
    curves = []
    for column in columns:
        for method in distinct(row["method"] for row in rows):
            points = [(row["difficulty"], row[column]) for row in rows if row["method"] == method]
            if not any(share > 0 for _, share in points):
                continue
            for methods, other, known in curves:
                if other == column and onsetOf(known) == onsetOf(points) and max(abs(p[1] - q[1]) for p, q in zip(points, known)) < 4:
                    methods.append(method)
                    break
            else:
                curves.append(([method], column, points))
    return curves


def onsetOf(points):
    return next(i for i, (_, share) in enumerate(points) if share > 0)


def anchorOf(points, others):
    """Where the label of a curve stands: soon after the onset, far from other curves."""
    onset = onsetOf(points)
    within = range(onset, len(points) if onset == 0 else min(onset + 5, len(points)))

    def merit(i):
        distance = min((abs(points[i][1] - other[i][1]) for other in others), default=100)
        return min(distance, 20) + min(points[i][1], 20) - 0.5 * (i - onset)
    return points[max(within, key=merit)]


def between(start, end, count=10):
    (x0, y0), (x1, y1) = start, end
    return [(x0 * (x1 / x0) ** (i / count), y0 + (y1 - y0) * i / count) for i in range(count + 1)]


def drawPanel(axes, rows, columns, sentence):
    curves = curvesOf(rows, columns)
    if not curves:
        axes.set_axis_off()
        axes.text(0.5, 0.5, sentence, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="#555555")
        return
    labels, covered = [], []
    for methods, column, points in curves:
        colour, strong = COLOUR[methods[0]], methods[0] in RECOMMENDED
        for k, method in enumerate(methods):  # those that share a curve: a thin line on a broad one
            axes.plot(*zip(*points), color=COLOUR[method], linewidth=(2.4 if strong or len(methods) > 1 else 1.6) - 1.4 * k,
                      linestyle=columns[column], zorder=(5 if strong else 3) + 0.1 * k)
        onset = onsetOf(points)
        axes.plot(*points[onset], MARK[methods[0]], color=colour, markersize=6, markeredgecolor="white", markeredgewidth=0.5, zorder=7)
        for start, end in zip(points, points[1:]):
            covered += between(start, end)
        where = "from the start" if onset == 0 else number(points[onset][0])
        others = [known for _, _, known in curves if known is not points]
        labels.append((f"{' and '.join(methods)}{SAYS[column]}: {where}", *anchorOf(points, others), colour, strong))
    placeLabels(axes, labels, covered)


def ticksOf(values):
    """Powers of ten, at most eight of them."""
    low, high = ceil(log10(min(values)) - 1e-9), floor(log10(max(values)) + 1e-9)
    step = next(step for step in (1, 2, 3, 4, 5, 10, 20, 25, 30, 50) if (high - low) / step <= 7)
    return [10.0 ** exponent for exponent in range(low, high + 1) if exponent % step == 0]


def prepare(axes, rows):
    values = distinct(row["difficulty"] for row in rows)
    axes.set_xscale("log")
    margin = (max(values) / min(values)) ** 0.02
    low, high = min(values) / margin, max(values) * margin
    axes.set_xlim(*((low, high) if values[-1] > values[0] else (high, low)))  # more difficult to the right
    axes.set_ylim(-5, 130)
    axes.yaxis.set_major_locator(FixedLocator([0, 50, 100]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:.0f} %"))
    fractions = rows[0]["sweep"] == "time step"
    axes.xaxis.set_major_locator(FixedLocator([1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1] if fractions else ticksOf(values)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"1/{1 / v:.0f}" if fractions and v < 1 else number(v)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.set_xlabel(f"{rows[0]['quantity']}   (more difficult →)", fontsize=8.5)
    axes.tick_params(labelsize=8)


def main(source, picture):
    rows = read(source)
    sweeps = distinct(row["sweep"] for row in rows)
    height = 1.5 + 1.75 * len(sweeps)
    figure, grid = plt.subplots(len(sweeps), 2, figsize=(10, height), sharey=True, squeeze=False)
    figure.subplots_adjust(left=0.07, right=0.985, top=1 - 1.45 / height, bottom=0.5 / height, hspace=0.75, wspace=0.06)
    figure.text(0.012, 1 - 0.1 / height, "Where each method starts to fail", fontsize=13, fontweight="bold", va="top")
    columns = [column for panel, _, _ in PANELS for column in panel]
    failing = {row["method"] for row in rows if any(row[column] > 0 for column in columns)}
    without = [method for method in distinct(row["method"] for row in rows) if method not in failing]
    caption = CAPTION.format(none=f"No such error at all: {', '.join(without)}." if without else "")
    figure.text(0.012, 1 - 0.42 / height, caption, fontsize=8, va="top", linespacing=1.35)
    for column, (_, title, _) in enumerate(PANELS):
        box = grid[0][column].get_position()
        figure.text(box.x0, 1 - 1.17 / height, title, fontsize=10.5, va="bottom", color="#333333")
    for line, sweep in enumerate(sweeps):
        own = [row for row in rows if row["sweep"] == sweep]
        for axes in grid[line]:
            prepare(axes, own)
        grid[line][0].set_title(sweep, loc="left", fontsize=10.5, pad=4)
    figure.canvas.draw()
    for line, sweep in enumerate(sweeps):
        own = [row for row in rows if row["sweep"] == sweep]
        for axes, (columns, _, sentence) in zip(grid[line], PANELS):
            drawPanel(axes, own, columns, sentence)
        grid[line][1].tick_params(labelleft=not grid[line][0].axison)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
