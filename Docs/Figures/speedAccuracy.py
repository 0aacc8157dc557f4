#!/usr/bin/python3
"""Draws speed against accuracy: speedAccuracy.py CSV PICTURE writes PICTURE.svg.

The CSV is the speed-accuracy.csv of Examples/SpeedAccuracy. Six series of its methods are drawn; its page shows all.
"""
import sys

from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter

from chartStyle import COLOUR, MARK, distinct, placeLabels, plt, read, save

# Method, setting and label at the point. The points of a method are one series; the key of each panel names it.
SHOWN = [("Intersection", "once a frame", ""), ("Proximity", "1/20 edge", "1/20"), ("Proximity", "1/5 edge", "1/5"),
         ("Proximity", "4/5 edge", "4/5"), ("Proximity in substeps", "1/20 edge; 2 substeps", "2"),
         ("Proximity in substeps", "1/20 edge; 4 substeps", "4"), ("Proximity in substeps", "1/20 edge; 8 substeps", "8"),
         ("Proximity in substeps", "1/20 edge; 16 substeps", "16"), ("FCL", "collide()", ""), ("Continuous", "exact", ""),
         ("Auto", "touching", "")]
RECOMMENDED = ("Auto", "Continuous")
LONGEST = 40  # milliseconds; longer times stand at the edge of the chart, with their value
CAPTION = """\
Filled marks above the line: touching pairs of triangles that a method does not report. White marks below: reported pairs that do not touch.
The best place is on the zero line, far to the left. Orange: the recommended methods, both without a thickness. Bars: quartiles of the time over repetitions.
Dashed: the best (Pareto) front of time and false negatives. No other method beats its methods in both. Times whose bars overlap count as equal.
Proximity reports near features by definition, within 1/20, 1/5 or 4/5 of the mean edge. Substeps run Proximity 1/20 2 to 16 times in each step.
Continuous reports impacts within the step, and misses none. Triangles that intersect throughout the step count as its false negatives."""


def frontOf(rows):
    """The Pareto front: rows that no other row beats in time and false negatives. Times differ if their quartiles do not overlap."""
    def isFaster(a, b):
        return a["ms_high"] < b["ms_low"]

    def beats(a, b):
        difference = a["false_negatives"] - b["false_negatives"]
        return difference <= 0 and isFaster(a, b) or difference < 0 and not isFaster(b, a)
    return sorted((row for row in rows if not any(beats(other, row) for other in rows)), key=lambda row: row["ms"])


def between(start, end, count=12):
    """Points of a line on the logarithmic axis."""
    (x0, y0), (x1, y1) = start, end
    return [(x0 * (x1 / x0) ** (i / count), y0 + (y1 - y0) * i / count) for i in range(count + 1)]


def drawSeries(axes, own, method):
    """Draws the points of a method. Returns what labels should not cover."""
    colour, strong = COLOUR[method], method in RECOMMENDED
    size, level = (8.5, 6) if strong else (6, 4)
    covered = []
    for sign, column in ((1, "false_negatives"), (-1, "false_positives")):
        curve = [(min(row["ms"], LONGEST), sign * row[column]) for row in own]
        axes.plot(*zip(*curve), color=colour, linewidth=1.1, alpha=0.75, zorder=3)
        for start, end in zip(curve, curve[1:]):
            covered += between(start, end)
    for row in own:
        x, up, down = min(row["ms"], LONGEST), row["false_negatives"], -row["false_positives"]
        axes.plot([x, x], [down, up], color=colour, linewidth=1.6 if strong else 0.8, alpha=1 if strong else 0.5, zorder=3)
        low, high = min(row["ms_low"], LONGEST), min(row["ms_high"], LONGEST)
        axes.plot([low, high], [up, up], color=colour, linewidth=2.4, zorder=level, solid_capstyle="butt")
        if down < 0:
            axes.plot([x], [down], MARK[method], markerfacecolor="white", color=colour, markersize=size - 1, markeredgewidth=1.1,
                      zorder=level)
        axes.plot([x], [up], MARK[method], color=colour, markersize=size, markeredgecolor="white", markeredgewidth=0.6, zorder=level)
        covered += between((x, down), (x, up)) + 3 * [(x, up), (x, down)] + between((low, up), (high, up))
    return covered


def drawFront(axes, front):
    """Draws the front as steps: at each time, the least false negatives that a method reaches."""
    xs, ys = [front[0]["ms"]], [front[0]["false_negatives"]]
    for row in front[1:]:
        xs += [row["ms"], row["ms"]]
        ys += [ys[-1], row["false_negatives"]]
    xs.append(axes.get_xlim()[1])
    ys.append(ys[-1])
    axes.plot(xs, ys, color="#777777", linewidth=1.2, linestyle=(0, (4, 2)), zorder=2.5)
    corners = list(zip(xs, ys))
    return [point for start, end in zip(corners, corners[1:]) for point in between(start, end, 8)]


def drawScene(axes, rows):
    covered = []
    for method in distinct(row["method"] for row in rows):
        covered += drawSeries(axes, [row for row in rows if row["method"] == method], method)
    front = frontOf(rows)
    covered += drawFront(axes, front)
    methods = distinct(row["method"] for row in rows)
    key = [Line2D([], [], marker=MARK[method], color=COLOUR[method], linestyle="none") for method in methods]
    axes.legend(key, [method.removeprefix("Proximity in ") for method in methods], loc="lower left", bbox_to_anchor=(-0.02, 0.99),
                ncol=len(methods), frameon=False, fontsize=8, handletextpad=0, handlelength=1.5, columnspacing=0.7, borderaxespad=0)
    labels = [(row["label"] if row["ms"] <= LONGEST else f"{row['label']}: {row['ms']:.0f} ms →", min(row["ms"], LONGEST),
               row["false_negatives"], COLOUR[row["method"]], False) for row in rows if row["label"]]
    placeLabels(axes, labels, covered)


def prepare(axes, scene, first, last):
    axes.axhspan(-112, 0, color="#f4f4f4", zorder=0)
    axes.axhline(0, color="#666666", linewidth=0.9, zorder=2)
    axes.set_title(scene, loc="left", pad=18)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.tick_params(labelbottom=True)
    if first:
        for y, text in ((0.75, "false negatives"), (0.25, "false positives")):
            axes.text(-0.135, y, text, transform=axes.transAxes, rotation=90, ha="center", va="center")
    if last:
        axes.set_xlabel("time (ms a frame, one thread)")


def main(source, picture):
    shown = {(method, setting): {"label": label} for method, setting, label in SHOWN}
    measured = {(row["scene"], row["method"], row["setting"]): row for row in read(source)}
    scenes = distinct(scene for scene, _, _ in measured)
    rows = [{**measured[scene, *key], **names} for scene in scenes for key, names in shown.items() if (scene, *key) in measured]
    lines = (len(scenes) + 1) // 2
    height = 1.9 + 3.0 * lines
    figure, grid = plt.subplots(lines, 2, figsize=(10, height), sharex=True, sharey=True, squeeze=False)
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 1.75 / height, bottom=0.55 / height, hspace=0.36, wspace=0.07)
    grid[0][0].set_xscale("log")
    grid[0][0].set_xlim(min(row["ms_low"] for row in rows) / 2, min(max(row["ms_high"] for row in rows), LONGEST) * 1.6)
    grid[0][0].set_ylim(-112, 112)
    grid[0][0].yaxis.set_major_locator(FixedLocator([-100, -50, 0, 50, 100]))
    grid[0][0].yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{abs(v):.0f} %"))
    grid[0][0].xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    for i, axes in enumerate(grid.flat):
        if i < len(scenes):
            prepare(axes, scenes[i], i % 2 == 0, i // 2 == lines - 1)
        else:
            axes.set_visible(False)
    figure.text(0.012, 1 - 0.1 / height, "Speed against accuracy on eight scenes", fontsize=13, fontweight="bold", va="top")
    figure.text(0.012, 1 - 0.42 / height, CAPTION, fontsize=8, va="top", linespacing=1.35)
    figure.canvas.draw()
    for scene, axes in zip(scenes, grid.flat):
        drawScene(axes, [row for row in rows if row["scene"] == scene])
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
