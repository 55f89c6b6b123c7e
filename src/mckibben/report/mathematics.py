"""Equations for the page: MathML, which browsers set themselves, made of LaTeX."""

from __future__ import annotations

from functools import lru_cache
from html import escape
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from markupsafe import Markup


@lru_cache(maxsize=1000)
def mathml(latex: str, display: Literal["block", "inline"] = "block") -> Markup:
    r"""Return an equation as MathML; as it is written, where that is no LaTeX.

    >>> "<mfrac>" in mathml(r"y = \frac{u}{2}")
    True
    """
    from latex2mathml.converter import convert
    from markupsafe import Markup

    try:
        found = convert(latex, display=display).replace(r"\_", "_")
    except Exception:  # of many kinds, none of which is worth a report
        found = f"<code>{escape(latex)}</code>"
    return Markup(found)  # the converter has escaped all text
