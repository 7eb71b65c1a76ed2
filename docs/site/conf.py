"""Sphinx configuration for `make site`. The pages come from the whole repository."""

import re
import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project, author = "flexaxis", "The flexaxis developers"
copyright = "the flexaxis developers, Apache-2.0"
version = release = version_of(project)
language = "en-GB"

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.viewcode",
              "sphinx_gallery.gen_gallery"]  # fmt: skip
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**", "models_mjcf/**/*.md"]
exclude_patterns = ["docs/*.py", "docs/site/**", "docs/examples/**", "docs/gallery/**",
                    "docs/notebooks/*.py", "docs/made/gallery/*.ipynb", "docs/made/gallery/*.py",
                    "docs/made/gallery/*.json"]  # fmt: skip
suppress_warnings = ["config.cache", "misc.highlighting_failure"]

# Pages are GitHub-style Markdown with formulas. Notebooks are shown with their stored output.
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 5
nb_execution_mode = "off"
nb_merge_streams = True

sphinx_gallery_conf = {
    "examples_dirs": "docs/gallery", "gallery_dirs": "docs/made/gallery",
    "filename_pattern": ".*", "show_memory": False, "write_computation_times": False,
    "download_all_examples": False, "remove_config_comments": True,
}  # fmt: skip
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # because numpydoc docstrings already give the types
numpydoc_show_class_members = False
default_role = "code"
add_module_names = False

html_theme, html_title = "furo", "flexaxis"
html_static_path, html_css_files = ["static"], ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
pygments_style, pygments_dark_style = "friendly", "github-dark"


def setup(app):
    """Register the generator of the reference pages, and the MathML renderer for formulas.

    MathML needs neither scripts nor a network connection.
    """
    import reference

    app.connect("builder-inited", lambda app: reference.write(Path(app.srcdir, "docs", "made")))
    app.add_html_math_renderer("mathml", (_formula, None), (_formula, None))


def _formula(self, node):
    from docutils import nodes
    from latex2mathml.converter import convert

    tex = re.sub(r"\\tag\{([^}]*)\}", r"\\qquad (\1)", node.astext())
    block = isinstance(node, nodes.math_block)
    text = convert(tex.strip(), display="block" if block else "inline")
    self.body.append(f'<div class="formula" tabindex="0">{text}</div>' if block else text)
    raise nodes.SkipNode
