#!/usr/bin/python3
"""Draws contacts missed against the budget: budgets.py CSV PICTURE writes PICTURE.svg.

The CSV is the budgets.csv of Examples/SpeedAccuracy.
"""
import sys

from chartStyle import distinct, plt, read, save

COLOURS = ["#777777", "#0072b2"]
PANELS = {"missed_first": "of the first pair", "missed": "of all ten pairs"}


def main(source, picture):
    rows = read(source)
    figure, grid = plt.subplots(1, len(PANELS), figsize=(10, 3.6), sharey=True)
    figure.subplots_adjust(left=0.075, right=0.985, top=0.8, bottom=0.15, wspace=0.08)
    for axes, (key, title) in zip(grid, PANELS.items()):
        axes.set_title(title, loc="left")
        axes.grid(True)
        axes.set_axisbelow(True)
        axes.set_xlabel("budget (% of the time of a complete detection)")
        for colour, order in zip(COLOURS, distinct(row["order"] for row in rows)):
            own = [row for row in rows if row["order"] == order]
            axes.plot([row["budget"] for row in own], [row[key] for row in own], "o-", color=colour, markersize=5, label=order)
        axes.set_xlim(0, 125)
        axes.set_ylim(0, 100)
    grid[0].set_ylabel("contacts missed (%)")
    grid[0].legend(loc="upper right", fontsize=8, frameon=False)
    figure.text(0.012, 0.985, "Contacts missed within a budget", fontsize=13, fontweight="bold", va="top")
    save(figure, picture)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
