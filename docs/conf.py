"""How the documentation is built; run `python docs/build.py`."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from mckibben import __version__

project = "mckibben"
author = "the developers of mckibben"
copyright = "the developers of mckibben"  # noqa: A001  # Sphinx's name
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "making.typeset"]
html_theme = "furo"
html_title = f"mckibben {os.environ.get('READTHEDOCS_VERSION_NAME', version)}"
html_baseurl = os.environ.get("READTHEDOCS_CANONICAL_URL", "")  # of the hosted site, by version
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(Path(__file__).parent / "making" / "scorer.js")
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"
exclude_patterns = ["_build", "gallery", "making", "templates/__pycache__", "README.md"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
autodoc_default_options = {
    "members": True,
    "show-inheritance": True,
    # scikit-learn adds these, and documents them elsewhere
    "exclude-members": "set_fit_request, set_score_request, set_predict_request, get_metadata_routing",
}
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
suppress_warnings = ["myst.header", "ref.python"]


def setup(app):
    """Let mathematics in docstrings be text."""

    def plain(app, what, name, member, options, lines):
        lines[:] = [line.replace("|", r"\|") if "`" not in line else line for line in lines]

    app.connect("autodoc-process-docstring", plain)
    return {"parallel_read_safe": True}
