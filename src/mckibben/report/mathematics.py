"""Equations for pages: MathML from LaTeX."""

from __future__ import annotations

from functools import lru_cache
from html import unescape
from typing import TYPE_CHECKING, Literal
from xml.etree.ElementTree import tostring

if TYPE_CHECKING:
    from markupsafe import Markup

ELEMENTS = frozenset(
    ("math", "mfrac", "mi", "mn", "mo", "mover", "mrow", "mspace", "msqrt", "msub", "msubsup",
     "msup", "mtable", "mtd", "mtext", "mtr", "munder", "munderover")
)  # fmt: skip
"""Of MathML, that equations of models are set with."""

ATTRIBUTES = frozenset(
    ("accent", "columnalign", "display", "fence", "form", "mathvariant", "maxsize", "minsize",
     "rowlines", "stretchy", "width", "xmlns")
)  # fmt: skip
"""Of these, none of which leads anywhere or runs anything."""


@lru_cache(maxsize=1000)
def mathml(latex: str, display: Literal["block", "inline"] = "block") -> Markup:
    r"""Return an equation as MathML; the source itself if it is not a LaTeX equation.

    >>> "<mfrac>" in mathml(r"y = \frac{u}{2}")
    True
    """
    from latex2mathml.converter import convert_to_element
    from markupsafe import Markup

    try:
        equation = convert_to_element(latex, display=display)
    except Exception:  # of many kinds, none of which is worth a report
        return Markup("<code>{}</code>").format(latex)
    for element in equation.iter():
        if element.tag not in ELEMENTS:
            return Markup("<code>{}</code>").format(latex)
        for name in element.attrib.keys() - ATTRIBUTES:
            del element.attrib[name]
        # texts hold entities; channels of files may be named like tags
        element.text = unescape(element.text or "").replace(r"\_", "_")
    return Markup(tostring(equation, encoding="unicode"))
