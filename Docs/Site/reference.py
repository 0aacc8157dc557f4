"""reference.py XML OUT HEADER...: writes one page of the C++ reference for each public header.

XML: the folder of Doxygen's XML. OUT: the folder of the pages. HEADER: a path that contains Public/palpate/.
"""
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

xml, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
headers = sys.argv[3:]
DIRECTIVES = {"struct": "doxygenstruct", "class": "doxygenclass", "enum": "doxygenenum", "typedef": "doxygentypedef",
              "variable": "doxygenvariable", "function": "doxygenfunction", "define": "doxygendefine"}

index = ElementTree.parse(xml / "index.xml").getroot()
namespaces = [ElementTree.parse(xml / (compound.get("refid") + ".xml")).getroot() for compound in index.iter("compound")
              if compound.get("kind") == "namespace"]
files = {compound.findtext("name"): compound.get("refid") for compound in index.iter("compound") if compound.get("kind") == "file"}


def text(element):
    return "".join(element.itertext()) if element is not None else ""


def signature(member):
    types = ", ".join(text(parameter.find("type")) for parameter in member.findall("param"))
    return f"{member.findtext('qualifiedname')}({types})"


def directives(header):
    """The directives of all that the header declares at namespace scope, in its order."""
    tree = ElementTree.parse(xml / (files[pathlib.Path(header).name] + ".xml")).getroot()
    found = []
    for inner in tree.iter("innerclass"):
        name, kind = inner.text, inner.get("refid")
        parent = name.rsplit("::", 1)[0]
        if any(parent == other.text for other in tree.iter("innerclass")):
            continue  # a member of a class that is listed
        compound = ElementTree.parse(xml / (kind + ".xml")).getroot().find("compounddef")
        line = int(compound.find("location").get("line"))
        found.append((line, DIRECTIVES[compound.get("kind")], name, "   :members:\n   :undoc-members:\n"))
    members = [member for root in [tree, *namespaces] for member in root.iter("memberdef")]
    for member in members:
        if not member.find("location").get("file").endswith(header):
            continue
        kind = member.get("kind")
        if kind not in DIRECTIVES or member.get("static") == "yes" and kind == "function":
            continue
        name = signature(member) if kind == "function" else member.findtext("qualifiedname") or member.findtext("name")
        found.append((int(member.find("location").get("line")), DIRECTIVES[kind], name, ""))
    return "".join(f".. {directive}:: {name}\n{options}\n" for _, directive, name, options in sorted(found))


names = []
for header in headers:
    page = directives(header)
    if not page:
        continue
    included = header.split("Public/palpate/", 1)[1]
    name = pathlib.Path(header).stem
    names.append(name)
    (out / f"{name}.md").write_text(f"# `<palpate/{included}>`\n\n```{{eval-rst}}\n{page}```\n", encoding="utf-8")
lines = "\n".join(names)
(out / "index.md").write_text(f"# C++ API\n\nOne page for each public header.\n\n```{{toctree}}\n:maxdepth: 1\n{lines}\n```\n",
                              encoding="utf-8")
