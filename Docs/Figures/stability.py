#!/usr/bin/python3
"""Draws where each method starts to fail: stability.py CSV PICTURE writes PICTURE.svg.

The CSV is the stability.csv of Testing/Stability, whose rows go from the easiest to the most difficult value of a sweep.
"""
import sys

from matplotlib.colors import LinearSegmentedColormap

from chartStyle import distinct, plt, read, save

# Columns of the CSV, and the title of their map.
MAPS = [(("false_negatives", "false_positives"), "False negatives and false positives"), (("wrong_side",), "Normals on the wrong side")]
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
COLOURS = LinearSegmentedColormap.from_list("onset", ["#8B1A00", "#D55E00", "#F3B380", "#FBE3D0"])  # from the start, late
NEVER = "#DCEFE8"


def number(value):
    """Two digits; powers of ten where these are shorter."""
    if 1e-3 <= value < 1e5:
        return f"{value:.2g}" if value < 10 else f"{value:.0f}"
    mantissa, exponent = f"{value:.1e}".split("e")
    mantissa = mantissa.removesuffix(".0")
    return ("" if mantissa == "1" else mantissa + "×") + "10" + str(int(exponent)).translate(SUPERSCRIPT)


def drawCell(axes, x, y, rows, columns):
    """The onset in words, and its place among the difficulties as a colour."""
    onset = next((i for i, row in enumerate(rows) if any(row[column] > 0 for column in columns)), None)
    if onset is None:
        colour, text = NEVER, "never"
    else:
        share = onset / (len(rows) - 1)
        colour, text = COLOURS(share), "at once" if onset == 0 else number(rows[onset]["difficulty"])
    dark = onset is not None and onset / (len(rows) - 1) < 0.45
    axes.add_patch(plt.Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", linewidth=2))
    axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", fontsize=9, color="white" if dark else "#333333")


def drawMap(axes, rows, columns, title):
    sweeps, methods = distinct(row["sweep"] for row in rows), distinct(row["method"] for row in rows)
    for y, sweep in enumerate(sweeps):
        for x, method in enumerate(methods):
            drawCell(axes, x, y, [row for row in rows if row["sweep"] == sweep and row["method"] == method], columns)
    quantities = [next(row["quantity"] for row in rows if row["sweep"] == sweep) for sweep in sweeps]
    axes.set_xlim(0, len(methods))
    axes.set_ylim(len(sweeps), 0)
    axes.set_xticks([x + 0.5 for x in range(len(methods))], [method.replace(" in ", "\nin ").replace(": ", ":\n") for method in methods],
                    fontsize=9)
    axes.set_yticks([y + 0.5 for y in range(len(sweeps))], [f"{sweep}\n{what}" for sweep, what in zip(sweeps, quantities)], fontsize=8)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(title, loc="left", pad=12)


def main(source, picture):
    rows = read(source)
    figure, grid = plt.subplots(2, 1, figsize=(9, 11.6))
    figure.subplots_adjust(left=0.33, right=0.99, top=0.885, bottom=0.035, hspace=0.2)
    figure.text(0.012, 0.988, "At which difficulty each method starts to fail", fontsize=13, fontweight="bold", va="top")
    figure.text(0.012, 0.966, "A cell has the first value of the sweep's quantity at which any case has the error. Its colour shows how early in the sweep this is.", fontsize=9, va="top")
    for axes, (columns, title) in zip(grid, MAPS):
        drawMap(axes, rows, columns, title)
    keys = [("never", NEVER), ("late", COLOURS(1.0)), ("halfway", COLOURS(0.5)), ("at once", COLOURS(0.0))]
    for k, (text, colour) in enumerate(keys):
        figure.patches.append(plt.Rectangle((0.33 + 0.16 * k, 0.012), 0.02, 0.011, facecolor=colour, transform=figure.transFigure))
        figure.text(0.358 + 0.16 * k, 0.0135, text, fontsize=9)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
