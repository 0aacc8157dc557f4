"""Sphinx configuration. CMake/docs.sh runs it over a copy of the Markdown files of the repository.

Comments of headers name pages ("Docs/Accuracy.md") and error codes ("ErrorCode::File"). In the reference both become links.
"""
import os
import re

from docutils import nodes
from sphinx.util import logging

project = "Palpate"
author = "The Palpate developers"
copyright = author
version = release = os.environ["PALPATE_VERSION"]

extensions = ["myst_parser", "breathe"]
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

LINK = re.compile(r"\bDocs/(\w+(?:/\w+)*)\.md\b|\bErrorCode::(\w+)")


def linkPages(app, doctree, docname):
    """Turns the names of pages and of error codes in the text of the reference into links."""
    if not docname.startswith("reference/"):
        return
    for text in list(doctree.findall(nodes.Text)):
        if not LINK.search(text) or not isinstance(text.parent, nodes.paragraph):
            continue
        parts, end = [], 0
        for match in LINK.finditer(text):
            page, code = match.groups()
            target = f"Docs/{page}" if page else "Docs/Errors"
            if target not in app.env.found_docs:
                logging.getLogger(__name__).warning("a comment of a header names %s, which is no page", match[0], location=docname)
            else:
                title = app.env.titles[target].astext() if page else code
                address = app.builder.get_relative_uri(docname, target) + (f"#{code.lower()}" if code else "")
                parts += [nodes.Text(text[end:match.start()]), nodes.reference("", title, refuri=address, internal=True)]
                end = match.end()
        text.parent.replace(text, parts + [nodes.Text(text[end:])])


def setup(app):
    app.connect("doctree-resolved", linkPages)
