"""The site: the pages of this folder, notebooks run, docstrings. ``make site`` builds it."""

from importlib.metadata import version as installed
from typing import Any

project, author = "shaftline", "the shaftline developers"
copyright = author
version = release = installed("shaftline")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinxcontrib.mermaid",
]
exclude_patterns = ["_build", "jupyter_execute", "_templates"]
suppress_warnings = ["myst.header", "docutils", "ref.python"]

# pages are written for a reader of the repository as well: plain links, headings as anchors
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]
myst_enable_extensions = ["dollarmath", "deflist"]

nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

autodoc_default_options = {
    "members": True, "imported-members": True, "exclude-members": "model_config",
}  # fmt: skip
autodoc_member_order = "alphabetical"
autodoc_typehints = "description"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"shaftline {version}"
html_static_path = ["_static"]
html_css_files = ["shaftline.css"]
templates_path = ["_templates"]
html_sidebars = {
    "**": [
        "sidebar/brand.html", "sidebar/search.html", "sidebar/versions.html",
        "sidebar/scroll-start.html", "sidebar/navigation.html", "sidebar/scroll-end.html",
    ]
}  # fmt: skip
copybutton_exclude = ".linenos, .gp, .go"


def unnumbered(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """A field of a named tuple stands there with its type; its number tells nobody anything."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()


def setup(app: Any) -> None:
    """What Sphinx calls."""
    app.connect("autodoc-process-docstring", unnumbered)
