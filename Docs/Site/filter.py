"""Doxygen input filter: gives the labels and examples of doc comments the form that Doxygen needs.

A label ("/// Errors   ...") is a capitalised word, or two words, at the start of a comment line, with two spaces or more
behind it. It becomes a paragraph with a title. An example is indented by two more spaces and follows an empty comment line.
"""
import re
import sys

LABEL = re.compile(r"^(\s*///) ([A-Z][a-z]+(?:\(\))?(?: [a-z]+)?)  +(\S.*)$")
EXAMPLE = re.compile(r"^\s*///   ")
EMPTY = re.compile(r"^\s*///$")

inExample = afterEmpty = False
for line in open(sys.argv[1], encoding="utf-8"):
    line = line.rstrip("\n")
    isExample = bool(EXAMPLE.match(line)) and (inExample or afterEmpty)
    if isExample != inExample:
        print("/// @code{.cpp}" if isExample else "/// @endcode")
    inExample, afterEmpty = isExample, bool(EMPTY.match(line))
    label = LABEL.match(line)
    if label and not isExample:
        print(f"{label[1]} @par {label[2]}")
        print(f"{label[1]} {label[3]}")
    else:
        print(line)
