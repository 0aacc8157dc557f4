#!/usr/bin/python3
"""Draws the force of a tool in tissue: forceCurve.py CSV PICTURE writes PICTURE.svg.

The CSV is the output of palpate_imstk_trials --curve (Testing/Imstk).
"""
import sys

from chartStyle import BLACK, BLUE, RECOMMENDED, distinct, plt, read, save

# Each series: its colour, style and label.
LOOK = {"Palpate": (RECOMMENDED, "-", "Palpate, guarded, 10 iterations"),
        "iMSTK": (BLUE, "-", "iMSTK's own classes, 10 iterations"),
        "Palpate converged": (BLACK, "--", "Palpate, guarded, 50 iterations")}
PHASES = [(0, 120, "press"), (120, 280, "hold"), (280, 400, "draw back")]
CAPTION = """\
A spring of stiffness 500 leads a capsule into NeoHookean tissue, holds it for 160 steps and draws it back, in iMSTK 7.0.
The force is that of the spring, as a haptic device renders it."""


def main(source, picture):
    rows = read(source)
    figure, axes = plt.subplots(figsize=(7.5, 4.2))
    figure.subplots_adjust(left=0.09, right=0.985, top=0.76, bottom=0.12)
    most = max(row["force"] for row in rows)
    for start, end, name in PHASES:
        axes.axvline(end, color="#cccccc", linewidth=0.8, zorder=0)
        axes.text((start + end) / 2, 1.12 * most, name, ha="center", va="top", color="#666666")
    for name in distinct(row["series"] for row in rows):
        own = [row for row in rows if row["series"] == name]
        colour, style, label = LOOK[name]
        axes.plot([row["step"] for row in own], [row["force"] for row in own], style, color=colour, linewidth=1.4,
                  label=label)
    axes.set_xlim(0, 400)
    axes.set_ylim(top=1.15 * most)
    axes.grid(True)
    axes.set_axisbelow(True)
    axes.set_xlabel("step of 10 ms")
    axes.set_ylabel("force of the spring")
    axes.legend(loc="lower center", fontsize=8, frameon=False)
    figure.text(0.012, 0.985, "Force of a tool in tissue", fontsize=13, fontweight="bold", va="top")
    figure.text(0.012, 0.9, CAPTION, fontsize=8, va="top", linespacing=1.35)
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
