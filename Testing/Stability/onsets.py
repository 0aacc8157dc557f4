#!/usr/bin/env python3
"""Writes the tables of a page from the sweeps' CSV: where each method starts to fail.

usage: onsets.py stability.csv PAGE.md

Each table stands in the page between the lines "<!-- table NAME -->" and "<!-- end -->". The program
replaces the lines between these marks only.
"""
import csv
import re
import sys


def share(value):
    return f"{value:.0f} %" if value >= 1 else f"{value:.1g} %"


def onset(rows, quantity):
    """The first difficulty at which the quantity is not zero, and its largest share. The easiest difficulty comes first."""
    values = [(float(row["difficulty"]), float(row[quantity])) for row in rows]
    failing = [difficulty for difficulty, value in values if value > 0]
    if not failing:
        return "-"
    where = "from the start" if failing[0] == values[0][0] else f"{failing[0]:.2g}"
    return f"{where} ({share(max(value for _, value in values))})"


def falseAnswers(rows):
    negatives, positives = onset(rows, "false_negatives"), onset(rows, "false_positives")
    if positives == "-":
        return negatives
    return ("" if negatives == "-" else negatives + "; ") + "false positives: " + positives


def onsets(cell, withQuantity=False):
    def write(figures):
        methods = list(dict.fromkeys(row["method"] for row in figures))
        heads = ["sweep"] + ["quantity"] * withQuantity + methods
        lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
        for sweep, quantity in dict.fromkeys((row["sweep"], row["quantity"]) for row in figures):
            own = [[row for row in figures if row["sweep"] == sweep and row["method"] == method] for method in methods]
            cells = [sweep] + [quantity] * withQuantity + [cell(rows) if rows else "" for rows in own]  # "": not in that run
            lines.append("| " + " | ".join(cells) + " |")
        return lines
    return write


def trust(figures):
    lines = ["| | impact missing or normal on the wrong side | of these, trusted | other answers, not trusted |", "|---|---|---|---|"]
    for method in dict.fromkeys(row["method"] for row in figures):
        rows = [row for row in figures if row["method"] == method and row["wrong"] != "nan"]
        if not rows:
            continue
        mean = {key: sum(float(row[key]) for row in rows) / len(rows) for key in ("wrong", "right_untrusted")}
        trusted = sum(float(row["wrong_trusted"]) for row in rows)
        lines.append(f"| {method} | {mean['wrong']:.1f} % | {trusted:.0f} | {mean['right_untrusted']:.1f} % |")
    return lines


TABLES = {"failed": onsets(falseAnswers, withQuantity=True), "wrong_side": onsets(lambda rows: onset(rows, "wrong_side")),
          "trust": trust}


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
