"""Configuration of the documentation site, which ``make site`` builds with Sphinx."""

from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

project, author = "shaftline", "the shaftline developers"
copyright = author
version = release = installed("shaftline")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "jupyter_execute", "_templates"]
suppress_warnings = ["myst.header", "docutils", "ref.python"]

# Pages are also read on the repository's web page, so links are plain and headings are the anchors.
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath", "deflist"]

nb_execution_mode = "cache"
nb_execution_timeout = 1800  # the training takes 3 minutes on two free cores
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

autodoc_default_options = {
    "members": True,
    "imported-members": True,
    "exclude-members": "model_config",
}
autodoc_member_order = "alphabetical"
autodoc_typehints = "description"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"shaftline {version}"
html_static_path = ["_static"]
html_css_files = ["shaftline.css"]
html_search_scorer = str(Path(__file__).with_name("_static") / "scorer.js")
templates_path = ["_templates"]
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/versions.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/scroll-end.html",
    ]
}
copybutton_exclude = ".linenos, .gp, .go"


def drop_field_numbers(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Remove "Alias for field number ..." from the documentation of named tuples."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()


def setup(app: Any) -> None:
    """Connect the handlers of this file to Sphinx."""
    app.connect("autodoc-process-docstring", drop_field_numbers)
