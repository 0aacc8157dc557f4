#!/usr/bin/env python3
"""merge.py BUILD OUT: merges the coverage of all copies of each line of Source, and writes it to OUT as .gcov files.

Templates, inline functions and SIMD code are compiled several times: for several types, in several files, for each
instruction set. gcovr would count the branches of each copy. Here, a branch is taken if it is taken in any copy. Copies of
a line match if they belong to functions that start at the same place and if their branches have the same form. Branches
that only exceptions reach are left out."""

import collections
import concurrent.futures
import json
import pathlib
import subprocess
import sys

build, out = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
source = pathlib.Path(__file__).resolve().parents[2] / "Source"


class File:
    def __init__(self):
        self.counts = collections.Counter()     # by line
        self.calls = collections.Counter()      # by function, which is named by its place
        self.branches = collections.defaultdict(collections.Counter)  # by line and copy: form and function


def coverage(notes):
    """What gcov says about one translation unit. Without data, nothing of it ran."""
    run = subprocess.run(["gcov", "--json-format", "--stdout", "--branch-probabilities", "--branch-counts",
                          notes.name], cwd=notes.parent, capture_output=True, check=True)
    return json.loads(run.stdout)["files"]


def decisions(branches):
    """The branches without both ways out of each call that may throw, as the call decides between them. On a line with
    such a call, branches that were never reached belong to the clean-up after an exception: g++ does not mark them. The
    first branch that leads to a decision of our own is listed in any case."""
    pairs = [branches[i:i + 2] for i in range(0, len(branches), 2)]
    throws = [any(branch["throw"] for branch in pair) for pair in pairs]
    kept = [pair for pair, isCall in zip(pairs, throws)
            if not isCall and (not any(throws) or any(branch["count"] for branch in pair))]
    return sum(kept, [])


files = collections.defaultdict(File)
with concurrent.futures.ThreadPoolExecutor(2) as pool:
    for unit in pool.map(coverage, sorted(build.rglob("*.gcno"))):
        for entry in unit:
            path = pathlib.Path(entry["file"])
            if source not in path.parents:
                continue
            file, starts = files[path], {}
            for function in entry["functions"]:
                place = starts[function["name"]] = (function["start_line"], function["start_column"])
                file.calls[place] += function["execution_count"]
            for line in entry["lines"]:
                number, taken = line["line_number"], decisions(line["branches"])
                file.counts[number] += line["count"]
                form = tuple(branch["fallthrough"] for branch in taken)
                for i, branch in enumerate(taken):
                    file.branches[number][starts.get(line.get("function_name")), form, i] += branch["count"]

out.mkdir(parents=True, exist_ok=True)
for path, file in files.items():
    calls = collections.defaultdict(list)
    for (line, column), count in sorted(file.calls.items()):
        calls[line].append(f"function {line}:{column} called {count} returned 0% blocks executed 0%")
    text = [f"        -:    0:Source:{path}"]
    for number, code in enumerate(path.read_text().splitlines(), 1):
        text += calls[number]
        count = file.counts.get(number)
        text.append(f"{'-' if count is None else count or '#####':>9}:{number:5}:{code}")
        copies = collections.defaultdict(list)
        for (function, form, _), taken in file.branches[number].items():
            copies[function, form].append(taken)
        # Where the same line has another form, copies that did not run say nothing.
        ran = [copy for copy in copies.values() if any(copy)] or list(copies.values())[:1]
        text += [f"branch {i:2} taken {taken}" for i, taken in enumerate(sum(ran, []))]
    name = str(path.relative_to(source.parent)).replace("/", "#")
    (out / f"{name}.gcov").write_text("\n".join(text) + "\n")
