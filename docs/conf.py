"""Configuration of the documentation; `make docs` builds it, and warnings are errors."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from edtk.version import __version__  # noqa: E402, after the path is set

project = "edtk"
author = "The edtk authors"
copyright = "the edtk authors, BSD-3-Clause"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "study_keys",
]
exclude_patterns = ["_build", "_ext"]
nitpicky = True
# Types are text here, as the pages of Python and numpy cannot be reached while this is built;
# links between pages, to functions and to methods are checked.
nitpick_ignore_regex = [("py:(class|exc)", r".*")]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # signatures say types; docstrings say shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples"),
    "gallery_dirs": "examples",
    "filename_pattern": r"/\d\d_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "abort_on_example_error": True,
    "show_memory": False,
    "min_reported_time": 1e6,  # times depend on the machine
}

html_math_renderer = "mathml"
html_theme = "pydata_sphinx_theme"
html_title = f"edtk {version}"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"index": []}
html_show_sourcelink = False
