"""The site of the documentation: `python -m sphinx -W -b html docs site`. What is built needs no network."""

import html
import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.domains.python import PyObject

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rigidimpulse import __version__

project = "rigidimpulse"
author = "rigidimpulse"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
highlight_language = "none"
default_role = "code"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}
python_maximum_signature_line_length = 100
toc_object_entries = False

html_theme = "furo"
html_title = f"rigidimpulse {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False


def visit_inline(self, node):
    """Write an equation within a line as MathML, which browsers draw themselves."""
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def visit_display(self, node):
    """Write an equation on lines of its own."""
    mathml = convert(node.astext(), display="block")
    self.body.append(f'<div class="equation" title="{html.escape(node.astext(), quote=True)}">{mathml}</div>')
    raise nodes.SkipNode


def plain_bars(app, what, name, thing, options, lines):
    """Docstrings are plain text, in which |v| is a length and no substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def plain_signature(app, what, name, thing, options, signature, returns):
    """Signatures with names of types and defaults as people write them."""
    if signature is None:
        return None
    signature = re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", signature)
    return re.sub(r"Material\(density[^)]*\)", "Material()", signature), returns


def setup(app):
    """Make MathML the way of equations, read docstrings before napoleon does, call attributes so."""
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"
    app.connect("autodoc-process-docstring", plain_bars, priority=400)
    app.connect("autodoc-process-signature", plain_signature)
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_display, None))


html_math_renderer = "mathml"
