"""How Sphinx builds these pages: ``python -m sphinx -W docs docs/_build``."""

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

project = "tetlux"
copyright = "2026, the authors of tetlux"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "tetlux"
# Pages load nothing from elsewhere.
html_theme_options = {"source_edit_link": "", "light_css_variables": {"font-stack": "system-ui, sans-serif"}}
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_show_sourcelink = False
html_show_sphinx = False
# Summaries would be fetched, which browsers refuse for pages that are files.
html_show_search_summary = False
html_math_renderer = "mathml"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# Links are checked by tests/test_readme.py.
# ref.python: words in the types of parameters are taken for attributes of several classes.
suppress_warnings = ["myst.xref_missing", "image.not_readable", "ref.python"]
autosummary_generate = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
default_role = "code"
# Blocks without a language are no program.
highlight_language = "text"
nitpicky = False


def _inline_math(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _math_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Write formulas as MathML, which browsers draw without a script."""
    app.add_html_math_renderer("mathml", (_inline_math, None), (_math_block, None))
