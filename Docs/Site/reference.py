"""reference.py XML OUT HEADER...: writes one page of the C++ reference for each public header.

XML: the folder of Doxygen's XML. OUT: the folder of the pages. HEADER: a path that contains Public/palpate/.
A page begins with the first "//" comment inside the header's namespace, which is about the header as a whole. Types
follow in the order of the header, each with a heading, then functions and constants. GROUPS has every header once.
"""
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

xml, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
headers = sys.argv[3:]
DIRECTIVES = {"struct": "doxygenstruct", "class": "doxygenclass", "enum": "doxygenenum", "typedef": "doxygentypedef",
              "variable": "doxygenvariable", "function": "doxygenfunction", "define": "doxygendefine"}
GROUPS = {
    "Detection": "OctreeBasedCD Settings Types Meshes AnalyticalGeometry ArrayAdapter",
    "Contacts and response": "CollisionData Tracking ConstraintRows Validity StepGuard ThreadTopology FeaturePairs",
    "Queries": "SpatialQueries Snapshot PenetrationTracker",
    "Bodies with an error bound": "DistanceField Simplify",
    "Files and display": "MeshFiles DataSets Window",
    "iMSTK": "PalpateScene PalpateCD PalpateCH",
    "Errors, measurement and checks": "Error FrameStatistics LooseOctree Capture FclEngine Executor Export",
}

index = ElementTree.parse(xml / "index.xml").getroot()
namespaces = [ElementTree.parse(xml / (compound.get("refid") + ".xml")).getroot() for compound in index.iter("compound")
              if compound.get("kind") == "namespace"]
files = {compound.findtext("name"): compound.get("refid") for compound in index.iter("compound") if compound.get("kind") == "file"}


def text(element):
    return "".join(element.itertext()) if element is not None else ""


def introduction(header):
    """The first comment of the namespace as Markdown, if it is not about one declaration."""
    body = pathlib.Path(header).read_text(encoding="utf-8").split("\nnamespace palpate", 1)
    found = re.match(r"[^\n]*\{\n\n((?:// ?[^/\n][^\n]*\n|//\n)+)\n", body[1]) if len(body) > 1 else None
    if not found:
        return ""
    lines = []
    for line in found[1].splitlines():
        label = re.match(r"// ([A-Z][a-z]+) {2,}(\S.*)", line)
        lines += ["", f"**{label[1]}.** {label[2]}"] if label else [line[2:].strip()]
    text = "\n".join(lines).replace("<", "\\<")
    return re.sub(r"\bDocs/(\w+(?:/\w+)*)\.md\b", r"[\1](/Docs/\1.md)", text) + "\n\n"


def signature(member):
    types = ", ".join(text(parameter.find("type")) for parameter in member.findall("param"))
    return f"{member.findtext('qualifiedname')}({types})"


def directives(header):
    """(line, directive, name, options) of all that the header declares at namespace scope, in its order."""
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
    return sorted(found)


def plain(name):
    """The name without "palpate::" and parameters."""
    return re.sub(r"\(.*", "", name).removeprefix("palpate::")


def section(heading, entries):
    blocks = "".join(f".. {directive}:: {name}\n{options}\n" for _, directive, name, options in entries)
    return f"## {heading}\n\n```{{eval-rst}}\n{blocks}```\n\n"


rows, stems = {}, [stem for group in GROUPS.values() for stem in group.split()]
for header in headers:
    found = directives(header)
    if not found:
        continue
    included, stem = header.split("Public/palpate/", 1)[1], pathlib.Path(header).stem
    if stems.count(stem) != 1:
        sys.exit(f"{header}: GROUPS of reference.py must have {stem} once")
    names = ", ".join(f"`{name}`" for name in dict.fromkeys(
        plain(entry[2]) + ("()" if entry[1] == "doxygenfunction" else "") for entry in found))
    rows[stem] = f"| [`<palpate/{included}>`]({stem}.md) | {names} |"
    types = [entry for entry in found if entry[1] in ("doxygenstruct", "doxygenclass", "doxygenenum", "doxygentypedef")]
    others = [entry for entry in found if entry not in types]
    page = "".join(section(f"`{plain(entry[2])}`", [entry]) for entry in types)
    page += section("Functions and constants", others) if others else ""
    (out / f"{stem}.md").write_text(f"# `<palpate/{included}>`\n\n{introduction(header)}{page}", encoding="utf-8")
if missing := set(stems) - set(rows):
    sys.exit(f"GROUPS of reference.py has {missing}, which no header is")
text = """# C++ API

This reference has one page for each public header. `<palpate/Palpate.h>` includes those of the library.
Include the headers of optional targets yourself.
[Errors](/Docs/Errors.md) explains the codes that functions throw, and [Settings](/Docs/Settings.md) lists all settings.
"""
for group, members in GROUPS.items():
    lines, table = "\n".join(members.split()), "\n".join(rows[stem] for stem in members.split())
    text += f"""
## {group}

| header | declares |
|---|---|
{table}

```{{toctree}}
:caption: {group}
:hidden:
:maxdepth: 1
{lines}
```
"""
(out / "index.md").write_text(text, encoding="utf-8")
