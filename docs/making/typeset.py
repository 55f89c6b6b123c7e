"""Mathematics as MathML, which browsers display without scripts or fonts."""

from __future__ import annotations

from typing import Any

from sphinx.util import logging

from mckibben.report.mathematics import mathml

logger = logging.getLogger(__name__)


def inline(writer: Any, node: Any) -> None:
    """Write a formula within a line."""
    writer.body.append(_set(node, "inline"))
    from docutils.nodes import SkipNode

    raise SkipNode


def displayed(writer: Any, node: Any) -> None:
    """Write a displayed formula, which scrolls if it is wider than the page."""
    writer.body.append(f'<div class="equation">{_set(node, "block")}</div>')
    from docutils.nodes import SkipNode

    raise SkipNode


def _set(node: Any, display: Any) -> str:
    latex = node.astext()
    text = str(mathml(latex, display))
    if not text.startswith("<math"):
        logger.warning("this is not understood as mathematics: %s", latex, location=node)
    return text


def setup(app: Any) -> dict[str, bool]:
    """Register the extension with Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
