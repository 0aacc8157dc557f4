#!/usr/bin/python3
"""Draws three methods on the fast needle: fastNeedle.py CSV PICTURE writes PICTURE.svg.

The CSV is that of speedAccuracy.py.
"""
import sys

from chartStyle import COLOUR, MARK, plt, read, save

# Method, setting, label, and whether the label stands on the left of its mark.
SHOWN = [("Proximity", "1/20 edge", "Proximity", False),
         ("Proximity in substeps", "1/20 edge; 16 substeps", "Proximity, 16 substeps", False), ("Auto", "touching", "Auto", True)]


def main(source, picture):
    rows = {(row["method"], row["setting"]): row for row in read(source) if row["scene"] == "fast needle"}
    figure, axes = plt.subplots(figsize=(8.3, 3.1))
    figure.subplots_adjust(left=0.11, right=0.97, top=0.86, bottom=0.18)
    axes.set_xscale("log")
    axes.set_xlim(0.01, 4)
    axes.set_ylim(-10, 125)
    axes.set_xticks([0.01, 0.1, 1], ["0.01", "0.1", "1"])
    axes.set_yticks([0, 50, 100], ["0 %", "50 %", "100 %"])
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.set_xlabel("time (ms a frame, one thread)", fontsize=11)
    axes.set_ylabel("missed pairs that touch", fontsize=11)
    axes.tick_params(labelsize=10)
    for method, setting, label, left in SHOWN:
        row = rows[method, setting]
        x, y = row["ms"], row["false_negatives"]
        axes.plot([x], [y], MARK[method], color=COLOUR[method], markersize=13, clip_on=False, zorder=5)
        axes.annotate(f"{label}: {y:.0f} %, {x:.2g} ms", (x, y), xytext=(-13 if left else 13, 0), textcoords="offset points", fontsize=11,
                      fontweight="bold", color=COLOUR[method], ha="right" if left else "left", va="center")
    axes.set_title("A needle passes a membrane in less than a frame: Auto misses nothing", loc="left", fontsize=12)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
