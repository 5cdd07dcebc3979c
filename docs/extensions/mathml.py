"""Equations as MathML, made when the site is built: browsers show it without any script, font or network."""

from typing import Any

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def as_mathml(formula: str, as_block: bool) -> str:
    """The equation `formula`, in LaTeX, as the text of a MathML element; MathError for what that cannot say."""
    if as_block and "\\\\" in formula and "\\begin{" not in formula:
        # What has several lines is aligned at its ampersands, as in Sphinx's other renderers.
        formula = f"\\begin{{aligned}}{formula}\\end{{aligned}}"
    # The line breaks inside are for people who read the source.
    return str(latex2mathml.tex2mathml(formula, as_block=as_block)).replace("\n", "")


def _inline(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(_converted(node, as_block=False))
    raise nodes.SkipNode


def _display(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_converted(node, as_block=True)}</div>')
    raise nodes.SkipNode


def _converted(node: nodes.Element, as_block: bool) -> str:
    try:
        return as_mathml(node.astext(), as_block)
    except (latex2mathml.MathError, SyntaxError) as error:
        raise ExtensionError(
            f"{node.source}:{node.line}: {node.astext()!r} cannot be shown as MathML: {error}"
        ) from error
