"""Doxygen input filter: gives the labels and examples of doc comments the form that Doxygen needs.

A label ("/// Errors   ...") is a capitalised word, or two words, at the start of a comment line, with two spaces or more
behind it. It becomes a paragraph with a title. An example is indented by two more spaces and follows an empty comment line.
In a paragraph "Errors" each error code gets the name of its enumeration.
"""
import pathlib
import re
import sys

LABEL = re.compile(r"^(\s*///) ([A-Z][a-z]+(?:\(\))?(?: [a-z]+)?)  +(\S.*)$")
EXAMPLE = re.compile(r"^\s*///   ")
EMPTY = re.compile(r"^\s*///$")


def errorCodes():
    """The enumerators of ErrorCode."""
    text = pathlib.Path("Source/Public/palpate/Error.h").read_text(encoding="utf-8")
    body = re.search(r"enum class ErrorCode \{(.*?)\n\};", text, re.DOTALL)[1]
    return re.findall(r"^  (\w+),", body, re.MULTILINE)


CODE = re.compile(r"(?<!:)\b(" + "|".join(errorCodes()) + r")\b(?!\()")


def withCodes(line, inErrors):
    """The line with error codes that Docs/Site/conf.py turns into links; "%": Doxygen makes none."""
    return CODE.sub(r"%ErrorCode::\1", line) if inErrors else line


def main(path):
    inExample = afterEmpty = inErrors = False
    for line in open(path, encoding="utf-8"):
        line = line.rstrip("\n")
        isExample = bool(EXAMPLE.match(line)) and (inExample or afterEmpty)
        if isExample != inExample:
            print("/// @code{.cpp}" if isExample else "/// @endcode")
        inExample, afterEmpty = isExample, bool(EMPTY.match(line))
        label = None if isExample else LABEL.match(line)
        if label:
            inErrors = label[2] == "Errors"
            print(f"{label[1]} @par {label[2]}")
            print(f"{label[1]} {withCodes(label[3], inErrors)}")
            continue
        if afterEmpty or not line.lstrip().startswith("///"):
            inErrors = False
        print(withCodes(line, inErrors) if line.lstrip().startswith("///") and not isExample else line)


main(sys.argv[1])
