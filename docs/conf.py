"""The documentation site: `uv run --group docs sphinx-build -W docs docs/_build`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # its two extensions

from importlib.metadata import version as installed_version

project = "gaitchain"
author = "The gaitchain authors"
project_copyright = author
release = version = installed_version("gaitchain")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "attribute_prose",
    "command_help",
]
exclude_patterns = ["_build"]

# Anchors are those that code hosts make of headings: pages are read in both places.
myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]

default_role = "code"  # what single backquotes mean here
autoclass_content = "both"  # with what the constructor takes
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "pydata_sphinx_theme"
html_title = f"gaitchain {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_context = {"default_mode": "auto"}
html_sidebars = {page: [] for page in ("start", "results", "references", "genindex")}
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 8,
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
}
