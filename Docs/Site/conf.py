"""Sphinx configuration. CMake/docs.sh runs it over a copy of the Markdown files of the repository."""
import os

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
