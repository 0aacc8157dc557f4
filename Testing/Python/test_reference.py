"""The Python reference of the documentation site has every public name, with its docstring."""

import inspect
import os
import pathlib
import sys

import pytest

import palpate
from palpate import cohort

sys.path.insert(0, str(pathlib.Path(os.environ["PALPATE_SOURCE"]) / "Docs" / "Site"))
import pythonReference  # noqa: E402

BINDING = palpate._palpate
DOCSTRINGS = pythonReference.docstringsOfBinding()
CONSTANTS = {"AnalyticalGeometry", "INFINITY", "LARGEST_MEASURE", "MAX_HULL_POINTS", "NO_ELEMENT"}


def bound_names():
    """("Class.member", object) of all that the extension module defines for users."""
    for name, value in vars(BINDING).items():
        if name.startswith("_") or name in CONSTANTS:
            continue
        yield name, value
        for member, inner in vars(value).items() if inspect.isclass(value) else ():
            if not member.startswith("_"):
                yield f"{name}.{member}", getattr(value, member, inner)


@pytest.mark.parametrize("name, value", bound_names())
def test_docstrings_are_those_of_the_package(name, value):
    assert value.__doc__ and DOCSTRINGS[name] == value.__doc__


def test_no_docstring_is_of_another_name():
    assert set(DOCSTRINGS) == {name for name, _ in bound_names()}


def test_every_public_name_has_an_entry():
    pages = pythonReference.pages()
    named = {name for page in pages if page.module == "palpate" for name in page.names}
    assert named == set(palpate.__all__) - CONSTANTS
    named = {name for page in pages if page.module == "palpate.cohort" for name in page.names}
    assert named == set(cohort.__all__)
    text = "".join(page.text for page in pages)
    for name, value in bound_names():
        kind = "class" if inspect.isclass(value) else "function"
        if "." in name:
            kind = "property" if isinstance(value, property) else "method"
        assert f".. py:{kind}:: {name.rsplit('.', 1)[-1]}" in text
        indent = 6 * " " if "." in name else 3 * " "
        assert pythonReference.reStructured(value.__doc__, indent) in text
