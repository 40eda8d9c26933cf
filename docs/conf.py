# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The site: `make docs` writes it to results/site.

Its source directory is the root of the clone, so that links on its pages lead to the same place there and here.
"""

from importlib.metadata import version as installed
from pathlib import Path
from urllib.request import urlopen

project = "dolfinx_contact"
copyright = "the dolfinx_contact authors, MIT licence"
version = release = installed("dolfinx_contact")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.intersphinx"]
extensions += ["sphinx_copybutton", "sphinx_codeautolink"]
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
# Pages of notes begin where it suits them; examples whose HTML has no flags of doctest get no links.
suppress_warnings = ["myst.header", "codeautolink.match_block"]

codeautolink_concat_default = True  # the blocks of a page are one script
codeautolink_inventory_map = {  # where DOLFINx has its classes, and where its reference
    f"dolfinx.fem.function.{name}": f"dolfinx.fem.{name}"
    for name in ("Constant", "Function", "FunctionSpace")
}

# Pages of others to which names lead. Their lists of names are fetched once; without network such names lead nowhere.
OTHERS = {
    "dolfinx": "https://docs.fenicsproject.org/dolfinx/main/python/",
    "ufl": "https://docs.fenicsproject.org/ufl/main/",
    "basix": "https://docs.fenicsproject.org/basix/main/python/",
    "petsc4py": "https://petsc.org/release/petsc4py/",
}


def fetched(address: str, file: Path) -> bool:
    """Whether a project's list of names could be fetched into a file."""
    try:
        with urlopen(f"{address}objects.inv", timeout=5) as found:
            names = found.read()
    except OSError:
        return False
    if not names.startswith(b"# Sphinx inventory"):
        return False
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(names)
    return True


intersphinx_mapping = {}
for name, address in OTHERS.items():
    file = Path(__file__).parents[1] / "build" / "docs" / "inventories" / f"{name}.inv"
    if not file.exists() and not fetched(address, file):
        break  # no network: no second time-out
    intersphinx_mapping[name] = (address, str(file))

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
