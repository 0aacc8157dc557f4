"""Sphinx configuration. CMake/docs.sh runs it over a copy of the Markdown files of the repository.

Comments of headers name pages ("Docs/Accuracy.md") and error codes ("ErrorCode::File"). In the reference both become links.
On all pages, names of functions ("advance()") and of types become links to the reference. Long classes of the reference
begin with a table of their members. search.js finds sections, which are written to a file of their own.
"""
import gc
import json
import os
import pathlib
import re

from docutils import nodes
from sphinx import addnodes
from sphinx.util import logging

# Garbage is collected less often: a collection walks what was read of all pages, and took half of the time.
gc.set_threshold(200_000, 50, 100)

project = "Palpate"
author = "The Palpate developers"
copyright = author
version = release = os.environ["PALPATE_VERSION"]

extensions = ["myst_parser", "breathe", "sphinx_copybutton"]
source_suffix = {".md": "markdown"}
root_doc = "index"
myst_heading_anchors = 4
breathe_projects = {"palpate": os.environ["PALPATE_DOXYGEN_XML"]}
breathe_default_project = "palpate"
breathe_default_members = ("members", "undoc-members")
breathe_show_include = True
primary_domain = "cpp"
highlight_language = "cpp"

html_theme = "furo"
html_title = "Palpate"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["static"]
templates_path = ["templates"]
html_css_files = ["site.css"]

LINK = re.compile(r"\bDocs/(\w+(?:/\w+)*)\.md\b|\bErrorCode::(\w+)|\b((?:\w+::)*\w+\(\)|(?:[A-Z]\w*::)+\w+)")
NAME = re.compile(r"(?:palpate(?:::|\.))?((?:\w+(?:::|\.))*\w+)(?:\(\))?")
# Classes whose function is meant where several have one of the same name.
FIRST = ["OctreeBasedCD", "SpatialQueries", "CollisionData", ""]
LONG = 6  # members of a class that begins with a table of them


def briefOf(content):
    """The first sentence of a description that does not begin with a label."""
    first = next((child for child in content if isinstance(child, nodes.paragraph)), None)
    if first is None or first.next_node(nodes.definition_list):
        return ""
    return re.split(r"(?<=[.:])\s", first.astext().strip(), 1)[0].rstrip(".:")


def addMembers(app, doctree):
    """Puts a table of the members, each with its first sentence, before those of a long class."""
    for each in doctree.findall(addnodes.desc):
        content, rows = each.next_node(addnodes.desc_content), {}
        for member in content.findall(addnodes.desc) if each["objtype"] in ("class", "struct") else ():
            name = member[0].next_node(addnodes.desc_name)
            own = each[0].next_node(addnodes.desc_name)
            if name is None or not member[0]["ids"] or not re.match(rf"(?!operator|{own.astext()}$)\w", name.astext()):
                continue
            call = "()" if member["objtype"] in ("function", "method") else ""
            row = rows.setdefault(name.astext() + call, [member[0]["ids"][0], ""])
            row[1] = row[1] or briefOf(member.next_node(addnodes.desc_content))
        if len(rows) < LONG:
            continue
        body = nodes.tbody()
        for name, (anchor, brief) in rows.items():
            link = nodes.reference("", "", nodes.literal("", name), refid=anchor, internal=True)
            body += nodes.row("", nodes.entry("", nodes.paragraph("", "", link)), nodes.entry("", nodes.paragraph("", brief)))
        group = nodes.tgroup("", nodes.colspec(colwidth=1), nodes.colspec(colwidth=3), body, cols=2)
        first = next(i for i, child in enumerate(content) if child.next_node(addnodes.desc, include_self=True))
        content.insert(first, nodes.table("", group, classes=["members"]))


def namesOf(env):
    """{name: {class or "": (page, anchor)}} of the C++ and Python references. Of overloads, the first counts."""
    found = {}
    for domain, separator in (("cpp", "::"), ("py", ".")):
        for full, _, kind, page, anchor, _ in env.get_domain(domain).get_objects():
            if kind in ("templateParam", "functionParam", "module"):
                continue
            parts = full.removeprefix("palpate" + separator).split(separator)
            found.setdefault(parts[-1], {}).setdefault(parts[-2] if len(parts) > 1 else "", (page, anchor))
    return found


def addressOf(env, name, isAlone):
    """The page and anchor that a name means, or None. isAlone: it has no parentheses, and must be a type or have a class."""
    *owners, last = re.split(r"::|\.", name)
    places = env.palpateNames.get(last, {})
    if owners:
        return places.get(owners[-1])
    if isAlone and not re.match("k?[A-Z]", last):
        return None
    if len(places) == 1:
        return next(iter(places.values()))
    return next((places[owner] for owner in FIRST if owner in places), None) if not isAlone else places.get("")


def linkNames(app, doctree, docname):
    """Turns names of functions and types into links to the reference. Code blocks and headings stay as they are."""
    env = app.env
    if not hasattr(env, "palpateNames"):
        env.palpateNames = namesOf(env)
    for literal in list(doctree.findall(nodes.literal)):
        match = NAME.fullmatch(literal.astext())
        if not match or any(isinstance(each, (nodes.reference, nodes.title)) for each in (literal.parent, literal.parent.parent)):
            continue
        place = addressOf(env, match[1], not literal.astext().endswith("()"))
        if place:
            address = app.builder.get_relative_uri(docname, place[0]) + "#" + place[1]
            literal.replace_self(nodes.reference("", "", literal.deepcopy(), refuri=address, internal=True))


def linkPages(app, doctree, docname):
    """Turns the names of pages, of error codes and of functions in the text of the reference into links."""
    if not docname.startswith("reference/"):
        return
    for text in list(doctree.findall(nodes.Text)):
        if not LINK.search(text) or not isinstance(text.parent, nodes.paragraph):
            continue
        parts, end = [], 0
        for match in LINK.finditer(text):
            page, code, function = match.groups()
            if function:
                place = addressOf(app.env, function.removesuffix("()"), not function.endswith("()"))
                if not place:
                    continue
                title, address = match[0], app.builder.get_relative_uri(docname, place[0]) + "#" + place[1]
            else:
                target = f"Docs/{page}" if page else "Docs/Errors"
                if target not in app.env.found_docs:
                    logging.getLogger(__name__).warning("a comment of a header names %s, which is no page", match[0], location=docname)
                    continue
                title = app.env.titles[target].astext() if page else code
                address = app.builder.get_relative_uri(docname, target) + (f"#{code.lower()}" if code else "")
            parts += [nodes.Text(text[end:match.start()]), nodes.reference("", title, refuri=address, internal=True)]
            end = match.end()
        text.parent.replace(text, parts + [nodes.Text(text[end:])])


def textOf(node, skipped):
    """The text of a node on one line, less that of nodes of the skipped kinds."""
    if isinstance(node, skipped) or "members" in (node.get("classes", []) if isinstance(node, nodes.Element) else []):
        return ""
    if not node.children or isinstance(node, addnodes.desc_parameterlist):
        return node.astext()
    separator = "" if isinstance(node, (nodes.TextElement, nodes.literal)) else " "
    return separator.join(textOf(child, skipped) for child in node.children)


def writeSections(app, exception):
    """Writes static/sections.js: [address, title of the page, heading, text] of each section and each entry of the reference."""
    if exception:
        return
    skipped, sections = (nodes.section, addnodes.desc, nodes.title, nodes.comment, nodes.raw, addnodes.toctree), []
    for page in sorted(app.env.found_docs):
        tree, title = app.env.get_doctree(page), app.env.titles[page].astext()
        for node in tree.findall(lambda each: isinstance(each, (nodes.section, addnodes.desc))):
            isEntry = isinstance(node, addnodes.desc)
            ids = node[0]["ids"] if isEntry else node["ids"]
            if not ids:
                continue
            isTop = not isEntry and node.parent is tree
            heading = "" if isTop else (node[0] if isEntry else node.next_node(nodes.title)).astext()
            text = re.sub(r"\s+", " ", " ".join(textOf(child, skipped) for child in node.children)).strip()
            name = node[0].next_node(addnodes.desc_name) if isEntry else None
            heading = name.astext() + ("()" if "(" in heading else "") if name is not None else heading
            sections.append([app.builder.get_target_uri(page) + ("" if isTop else "#" + ids[0]), title, heading, text])
    path = pathlib.Path(app.outdir) / "_static" / "sections.js"
    path.write_text("const kSections = " + json.dumps(sections, ensure_ascii=False, indent=0) + ";\n", encoding="utf-8")


def setup(app):
    app.connect("doctree-read", addMembers)
    app.connect("doctree-resolved", linkNames)
    app.connect("doctree-resolved", linkPages)
    app.connect("build-finished", writeSections)
