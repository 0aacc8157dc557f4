#!/usr/bin/env python3
"""Writes the tables of a page from the sweeps' CSV: where each method starts to fail.

usage: onsets.py stability.csv PAGE.md

Each table stands in the page between the lines "<!-- table NAME -->" and "<!-- end -->"; what is
between them is replaced, all else stays.
"""
import csv
import re
import sys


def onset(rows, quantity):
    """The first difficulty at which the quantity is not zero, comfortable first, and its worst."""
    values = [(float(row["difficulty"]), float(row[quantity])) for row in rows]
    if not values:
        return ""  # not in that run
    failing = [difficulty for difficulty, value in values if value > 0]
    if not failing:
        return "-"
    where = "from the start" if failing[0] == values[0][0] else f"{failing[0]:.2g}"
    return f"{where} ({max(value for _, value in values):.0f} %)"


def onsets(quantity):
    def write(figures):
        methods = list(dict.fromkeys(row["method"] for row in figures))
        lines = ["| | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
        for sweep in dict.fromkeys(row["sweep"] for row in figures):
            cells = [onset([r for r in figures if r["sweep"] == sweep and r["method"] == m], quantity) for m in methods]
            lines.append(f"| {sweep} | " + " | ".join(cells) + " |")
        return lines
    return write


def trust(figures):
    lines = ["| | answers wrong | wrong and trusted | right and not trusted |", "|---|---|---|---|"]
    for method in dict.fromkeys(row["method"] for row in figures):
        rows = [row for row in figures if row["method"] == method and row["wrong"] != "nan"]
        if not rows:
            continue
        mean = {key: sum(float(row[key]) for row in rows) / len(rows) for key in ("wrong", "alarms")}
        silent = sum(float(row["silent"]) for row in rows)
        lines.append(f"| {method} | {mean['wrong']:.1f} % | {silent:.0f} | {mean['alarms']:.1f} % |")
    return lines


TABLES = {"failed": onsets("failed"), "turned": onsets("turned"), "flipped": onsets("flipped"), "trust": trust}


def main(figures_path, page_path):
    with open(figures_path, newline="") as file:
        figures = [row for row in csv.DictReader(file)]
    with open(page_path) as file:
        page = file.read()

    def table(match):
        return f"<!-- table {match[1]} -->\n" + "\n".join(TABLES[match[1]](figures)) + "\n<!-- end -->"

    page = re.sub(r"<!-- table (\S+) -->\n.*?<!-- end -->", table, page, flags=re.DOTALL)
    with open(page_path, "w") as file:
        file.write(page)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
