"""How Sphinx builds these pages: ``python -m sphinx -W docs docs/_build``."""

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
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
napoleon_use_ivar = True
# Names in docstrings are links where the reference has them, and apostrophes stay, as in sigma_s'.
default_role = "py:obj"
smartquotes_action = "D"
# Blocks without a language are no program.
highlight_language = "text"
nitpicky = False


def _inline_math(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _math_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def _keep_first_line(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Keep the first line of a property whole: napoleon takes what is before its colon for a type."""
    if what == "property":
        lines[:0] = ["..", ""]


def _split_and_link(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Give each of several attributes on one line a line of its own, as parameters have, and link returned types."""
    text = "\n".join(lines)
    found = r"^:(ivar|vartype) (\w+), (\w+):(.*(?:\n +.*)*)$"
    text = re.sub(found, r":\1 \2:\4\n:\1 \3:\4", text, flags=re.MULTILINE)
    lines[:] = re.sub(r"^(:returns: )\*([A-Z]\w+)\*", r"\1`\2`", text, flags=re.MULTILINE).split("\n")


def _readable_signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Leave private parameters out, and write defaults by their names."""
    if signature is not None:
        signature = re.sub(r", _\w+=<factory>|\*args, \*\*kwargs", "", signature).replace("=<factory>", "=...")
        signature = re.sub(r"<(?:function|class) '?(?:\w+\.)*(\w+)[^>]*>", r"\1", signature)
    return signature, returns


def _skip(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Leave out members that only say where they are described, and the class that a default is."""
    refers = str(getattr(thing, "__doc__", "")).startswith(("See `Spot`", "See `tetlux.fem.sources.deposit"))
    return True if refers or name == "model_of" else None


def setup(app: Sphinx) -> None:
    """Write formulas as MathML, which browsers draw without a script, and signatures as they are meant."""
    app.add_html_math_renderer("mathml", (_inline_math, None), (_math_block, None))
    app.connect("autodoc-process-docstring", _keep_first_line, priority=400)
    app.connect("autodoc-process-docstring", _split_and_link, priority=600)
    next(field for field in PyObject.doc_field_types if field.name == "variable").label = "Attributes"
    app.connect("autodoc-process-signature", _readable_signature)
    app.connect("autodoc-skip-member", _skip)
