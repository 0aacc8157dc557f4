#!/usr/bin/env python3
"""report.py COVERAGE: prints the lines and branches of each module from gcovr's JSON file and writes their sum to
Docs/Notes/Coverage.md. Lists what no test reaches in the checked modules and explained.txt does not explain: branches, and
functions that are never called. Exit code 1 if there are any, or if an explanation applies to nothing."""

import collections
import datetime
import json
import pathlib
import re
import sys

CHECKED = ("Math", "Octree", "Contact", "NarrowPhase")
root = pathlib.Path(__file__).resolve().parents[2]
page = root / "Docs/Notes/Coverage.md"


def explained():
    """The keys of explained.txt: (file, content of the line)."""
    text = (pathlib.Path(__file__).parent / "explained.txt").read_text()
    return {tuple(line.split(": ", 1)) for line in text.splitlines() if line and line[0] not in "# "}


modules = collections.defaultdict(collections.Counter)
unreached = []  # (file, line, content, what)
for entry in json.loads(pathlib.Path(sys.argv[1]).read_text())["files"]:
    path = pathlib.PurePath(entry["file"]).relative_to("Source")
    code = (root / entry["file"]).read_text().splitlines()
    module = modules[path.parts[0]]

    def miss(number, what):
        if path.parts[0] in CHECKED:
            unreached.append((str(path), number, code[number - 1].strip(), what))

    for function in entry["functions"]:
        if function["execution_count"] == 0:
            miss(function["lineno"], "the function is never called")
    for line in entry["lines"]:
        if line["gcovr/noncode"]:
            continue
        taken = [branch["count"] > 0 for branch in line["branches"]]
        module.update(lines=1, run=line["count"] > 0, branches=len(taken), taken=sum(taken))
        if not all(taken):
            missing = ", ".join(str(i) for i, isTaken in enumerate(taken) if not isTaken)
            miss(line["line_number"], f"branches {missing} of {len(taken)} are never taken")

table = ["| module | lines | run | branches | taken |", "|---|---|---|---|---|"]
for name, n in [*sorted(modules.items()), ("all", sum(modules.values(), collections.Counter()))]:
    share = lambda part, whole: f"{100 * n[part] / n[whole]:.1f} %" if n[whole] else "-"
    table.append(f"| {name} | {n['lines']} | {share('run', 'lines')} | {n['branches']} | {share('taken', 'branches')} |")
print("\n".join(table))
heading = f"Measured on {datetime.date.today():%d %B %Y}:\n\n"
page.write_text(re.sub(r"(?s)(<!-- table coverage -->\n).*(<!-- end -->)",
                       lambda m: m[1] + heading + "\n".join(table[:2] + table[-1:]) + "\n" + m[2], page.read_text()))

explanations = explained()
open_ = [miss for miss in unreached if (miss[0], miss[2]) not in explanations]
stale = explanations - {(file, content) for file, _, content, _ in unreached}
print(f"\nin {', '.join(CHECKED)}: {len(unreached)} lines not fully reached, of which {len(open_)} are not explained")
for file, number, content, what in open_:
    print(f"Source/{file}:{number}: {what}: {content}")
for file, content in sorted(stale):
    print(f"explained.txt: applies to nothing: {file}: {content}")
sys.exit(bool(open_ or stale))
