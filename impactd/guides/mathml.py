"""A Sphinx extension: equations become MathML when the manual is built.

A reader's browser then draws them by itself. It fetches no script and no font for them.
"""

from __future__ import annotations

import re

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

_log = logging.getLogger(__name__)
_DIGIT_FRACTION = re.compile(r"(\\[td]?frac)\s*(\d)\s*(\d)")
"""TeX reads one digit for each argument, docutils all digits for the first."""
_MISREAD = re.compile(r"\\[td]?frac\s*[^{\sa-z]\S*|\\sqrt\s*\d\d+|[\^_]\s*\d\d+")
"""Where docutils would take more digits for one argument than TeX does, without a word."""


def _inline(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body.append(_mathml(node, as_block=False))
    raise nodes.SkipNode


def _display(writer: HTML5Translator, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="math">{_mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, *, as_block: bool) -> str:
    try:
        return mathml_of(node.astext(), as_block=as_block)
    except MathError as error:
        _log.warning("an equation cannot be drawn: %s: %s", node.astext(), error, location=node)
        return ""


def mathml_of(tex: str, *, as_block: bool) -> str:
    """Return MathML, or raise `MathError` where docutils cannot read an equation or misreads it."""
    text = _DIGIT_FRACTION.sub(r"\1{\2}{\3}", tex).replace(r"\dots", r"\ldots")
    misread = _MISREAD.search(text)
    if misread:
        raise MathError(f"put braces around the arguments at {misread[0]!r}")
    return str(tex2mathml(text, as_block=as_block))


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
