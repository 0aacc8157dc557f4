"""The Python blocks of the pages run, and print what the pages say."""

import contextlib
import io
import os
import pathlib
import re

import pytest
import standins

SOURCE = pathlib.Path(os.environ["PALPATE_SOURCE"])
PAGES = [
    page
    for page in sorted((SOURCE / "Docs").rglob("*.md"))
    if "```python" in page.read_text()
]
BLOCK = re.compile(r"^(?:<!-- (.*?) -->\n)?```(python|text)\n(.*?)^```$", re.S | re.M)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_blocks_run(page, monkeypatch):
    """All blocks of a page are one program."""
    standins.install(monkeypatch)
    names, printed = {}, ""
    for mark, language, code in BLOCK.findall(page.read_text()):
        if language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(code, f"{page.name}", "exec"), names)
            printed = out.getvalue()
        elif mark == "output, Python" or (mark == "output" and page.stem == "Python"):
            assert code == printed


def test_pages_are_found():
    pages = {"Python", "PythonSofa", "PythonMuJoCo", "PythonTrimesh"}
    assert {page.stem for page in PAGES} >= pages


def test_five_lines_in_the_start_page():
    first = BLOCK.search((SOURCE / "Docs" / "Python.md").read_text())
    assert len(first[3].splitlines()) <= 7
