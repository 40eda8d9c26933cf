"""The site: `make docs` writes it to results/site.

Its source directory is the root of the clone, so that links on its pages lead to the same place there and here.
"""

from importlib.metadata import version as installed

project = "dolfinx_contact"
copyright = "the dolfinx_contact authors, MIT licence"
version = release = installed("dolfinx_contact")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
extensions += [
    f"docs.extension.{name}"
    for name in ("runs", "gallery", "docstrings", "headers", "formulas", "links", "together")
]

root_doc = "docs/index"
include_patterns = ["docs/**.md", "notes/*.md", "CHANGELOG.md", "CONTRIBUTING.md"]
exclude_patterns = [".*", "build", "results", "cpp", "tests", "demos", "studies", "benchmarks"]

myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_block"]
myst_heading_anchors = 3
nitpicky = False
suppress_warnings = ["myst.header"]  # pages of notes begin where it suits them

autodoc_member_order = "bysource"
autodoc_typehints = "description"  # beside the name; units and shapes in the text
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
napoleon_google_docstring = True
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_attr_annotations = False

html_theme = "furo"
html_title = "dolfinx_contact"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_extra_path = ["extra"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False


def setup(app) -> None:
    app.connect("env-updated", leave_notes_out)


def leave_notes_out(app, env) -> None:
    """Dated notes are linked by notes/README and stand in no table of contents, which is no mistake."""
    for name in env.found_docs:
        if name.startswith("notes/2"):
            env.metadata[name]["orphan"] = True
