"""Configuration of Sphinx; `build.py` calls it with a folder of staged sources."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "flexaxis"
author = "The flexaxis developers"
copyright = "the flexaxis developers, Apache-2.0"
version = release = version_of(project)
language = "en-GB"

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "mathml"]

# Markdown as GitHub shows it, formulas besides; notebooks with the outputs that they have.
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 5
nb_execution_mode = "off"
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc says types in words
autodoc_inherit_docstrings = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
default_role = "code"
add_module_names = False
python_display_short_literal_types = True
viewcode_line_numbers = True

html_theme = "furo"
html_title = "flexaxis"
html_static_path = [str(HERE / "static")]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
pygments_style, pygments_dark_style = "friendly", "github-dark"
