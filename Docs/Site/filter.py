"""Doxygen input filter: gives the labels of doc comments ("/// Errors   ...") the form of titled paragraphs.

A label is a capitalised word, or two words, at the start of a comment line, with two spaces or more behind it.
"""
import re
import sys

LABEL = re.compile(r"^(\s*///) ([A-Z][a-z]+(?:\(\))?(?: [a-z]+)?)  +(\S.*)$")

for line in open(sys.argv[1], encoding="utf-8"):
    line = line.rstrip("\n")
    label = LABEL.match(line)
    if label:
        print(f"{label[1]} @par {label[2]}")
        print(f"{label[1]} {label[3]}")
    else:
        print(line)
