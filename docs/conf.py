"""How Sphinx builds these pages: ``python -m sphinx -W docs docs/_build``."""

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
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# Links are checked by tests/test_readme.py.
suppress_warnings = ["myst.xref_missing", "image.not_readable"]
autosummary_generate = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
default_role = "code"
# Blocks without a language are no program.
highlight_language = "text"
nitpicky = False
