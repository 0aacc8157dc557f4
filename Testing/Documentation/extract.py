#!/usr/bin/env python3
"""extract.py ROOT OUT: writes a CMake project to OUT with every code block of README.md and Docs.

C++     all cpp blocks of a page form the body of one function. Only hidden code uses ExampleMeshes.h. An HTML comment
        on the line before a block changes that:
        <!-- program -->            the block starts a new program
        <!-- file scope -->         the block stands outside the function
        <!-- not run: ... -->       the block starts a new program, which is compiled only
        <!-- not compiled: ... -->  code of another library, or calls that no longer exist
        A block with `int main(` is a program alone. Hidden code is a comment that starts with a line `<!-- hidden` or
        `<!-- hidden, file scope` and ends with a line `-->`.
C       a c block is a program of its own, compiled as C99.
Output  <!-- output --> before a text block: the program before it prints exactly this.
CMake   each cmake block becomes a project of its own, which is configured; see Testing/Documentation/CMakeLists.txt.
Shell   each bash block must be valid, and the files of the repository that it names must exist.
Text, JSON and BibTeX are shown only. A block of another language is an error.
"""
import pathlib
import re
import subprocess
import sys

COMMENT = re.compile(r"\s*<!--\s*(program|file scope|output|(?:not compiled|not run): .+?)\s*-->\s*$")
HIDDEN = re.compile(r"\s*<!--\s*hidden(, file scope)?\s*$")
FENCE = re.compile(r"(\s*)```+\s*([A-Za-z{:}]*)")
SHOWN_ONLY = {"", "text", "json", "bibtex", "python"}  # Testing/Python runs the Python blocks


class Program:
    def __init__(self, page, number):
        self.name = re.sub(r"\W", "_", str(page.with_suffix(""))) + f"_{number}"
        self.head, self.body, self.whole, self.output = [], [], None, None
        self.suffix = "cpp"
        self.runs = True

    def add(self, code, where, file_scope):
        if "int main(" in code:
            self.whole = code
            return
        out = self.head if file_scope else self.body
        out.append(f"#line {where[1]} \"{where[0]}\"")
        for line in code.splitlines():
            if line.startswith("#include"):
                self.head.insert(0, line)
                out.append("")
            else:
                out.append(line)

    def text(self):
        if self.whole is not None:
            return self.whole
        parts = ["#include \"ExampleMeshes.h\"", "#include <palpate/Palpate.h>", "#include <array>",
                 "#include <cstdio>", "#include <vector>", *self.head, "int main() {", *self.body, "}"]
        return "\n".join(parts) + "\n"


def blocks(page, lines):
    """Yields (language, marks, code, line) for each fenced block and each hidden comment."""
    marks, i = [], 0
    while i < len(lines):
        line = lines[i]
        comment, hidden, fence = COMMENT.match(line), HIDDEN.match(line), FENCE.match(line)
        if comment:
            marks.append(comment.group(1))
        elif hidden or fence:
            end = r"\s*-->\s*$" if hidden else r"\s*```+\s*$"
            start = i + 1
            i = start
            while i < len(lines) and not re.match(end, lines[i]):
                i += 1
            if i == len(lines):
                sys.exit(f"{page}:{start}: the block does not end")
            indent = len(fence.group(1)) if fence else 0
            code = "\n".join(text[indent:] for text in lines[start:i]) + "\n"
            if hidden:
                yield "cpp", ["hidden"] + (["file scope"] if hidden.group(1) else []) + marks, code, start + 1
            else:
                yield fence.group(2), marks, code, start + 1
            marks = []
        elif line.strip():
            if marks:
                sys.exit(f"{page}:{i + 1}: `{marks[0]}` belongs to the line before a block")
        i += 1


def check_shell(page, line, code, root):
    run = subprocess.run(["bash", "-n"], input=code, text=True, capture_output=True)
    if run.returncode:
        sys.exit(f"{page}:{line}: {run.stderr}")
    for path in re.findall(r"\b(?:CMake|Testing|Docs|Examples|Data)/[\w./-]+", re.sub(r"\bbuild/\S+|\bout/\S+", "", code)):
        if not (root / path).exists():
            sys.exit(f"{page}:{line}: there is no {path}")


def main():
    root, out = (pathlib.Path(argument) for argument in sys.argv[1:])
    pages = [pathlib.Path("README.md"), pathlib.Path("CONTRIBUTING.md"), pathlib.Path("CHANGELOG.md")]
    pages += sorted(path.relative_to(root) for path in (root / "Docs").rglob("*.md"))
    programs, projects = [], []
    for page in pages:
        program, number = None, 0
        for language, marks, code, line in blocks(page, (root / page).read_text().splitlines()):
            if any(mark.startswith("not compiled") for mark in marks) or language.startswith("{"):
                continue
            if language in ("c", "cpp"):
                if "hidden" not in marks and "example::" in code:
                    sys.exit(f"{page}:{line}: the block shows a name of ExampleMeshes.h, which readers do not have")
                alone, runs = "int main(" in code, not any(mark.startswith("not run") for mark in marks)
                if program is None or "program" in marks or alone or not runs or program.whole is not None:
                    number += 1
                    program = Program(page, number)
                    program.runs = runs
                    program.suffix = language
                    programs.append(program)
                program.add(code, (page, line), "file scope" in marks)
            elif language == "text" and "output" in marks and page.stem != "Python":
                if program is None:
                    sys.exit(f"{page}:{line}: no program prints this")
                program.output = (program.output or "") + code
            elif language == "cmake":
                projects.append((f"{page.stem}_{line}", code))
            elif language in ("bash", "sh"):
                check_shell(page, line, code, root)
            elif language not in SHOWN_ONLY:
                sys.exit(f"{page}:{line}: a block of `{language}` is neither compiled nor known as text")
    if not programs or not projects:
        sys.exit("no code blocks found")

    (out / "programs").mkdir(parents=True, exist_ok=True)
    for program in programs:
        (out / "programs" / f"{program.name}.{program.suffix}").write_text(program.text())
        expected = out / "programs" / f"{program.name}.txt"
        expected.unlink(missing_ok=True)
        if program.output is not None:
            expected.write_text(program.output)
    for name, code in projects:
        folder = out / "projects" / name
        folder.mkdir(parents=True, exist_ok=True)
        head = "" if "project(" in code else "cmake_minimum_required(VERSION 3.25)\nproject(Block LANGUAGES C CXX)\n"
        targets = set(re.findall(r"target_link_libraries\((\w+)", code)) - set(re.findall(r"add_executable\((\w+)", code))
        head += "".join(f"add_executable({target} main.cpp)\n" for target in sorted(targets))
        (folder / "CMakeLists.txt").write_text(head + code)
        for source in {"main.cpp", *re.findall(r"\b\w+\.cpp\b", code)}:
            (folder / source).write_text("#include <palpate/Palpate.h>\nint main() { palpate::OctreeBasedCD collisions; }\n")
    names = {"programs": [program.name for program in programs if program.suffix == "cpp"],
             "programsInC": [program.name for program in programs if program.suffix == "c"],
             "whole": [program.name for program in programs if program.whole is not None],
             "notRun": [program.name for program in programs if not program.runs],
             "projects": [name for name, _ in projects]}
    (out / "names.cmake").write_text("".join(f"set({key} {' '.join(value)})\n" for key, value in names.items()))
    print(f"{len(programs)} programs, {len(projects)} CMake projects")


if __name__ == "__main__":
    main()
