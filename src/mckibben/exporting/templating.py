"""Generated sources: templates and numeric literals of C."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from jinja2 import Environment

MARKUP = (".xml.j2", ".html.j2")
"""Endings of templates whose values are escaped; those of C come through `naming.said`."""

WIDTH = 92
"""Width of rows of numbers [columns]."""

CODE_WIDTH = 100
"""Width of lines of C [columns]."""


def render(package: str, template: str, content: Mapping[str, Any]) -> str:
    """Return a rendered template of a package's folder ``templates``; all variables must be defined."""
    return _environment(package).get_template(template).render(content)


@cache
def _environment(package: str) -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(package),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=lambda template: template is not None and template.endswith(MARKUP),
    )


def literal(value: float, *, single: bool = False) -> str:
    """Return a number as a C literal: the shortest decimals that are exact.

    >>> literal(0.1), literal(0.1, single=True), literal(3.0), literal(float("inf"))
    ('0.1', '0.1f', '3.0', 'MCK_INFINITY')
    """
    if math.isinf(value):
        return "MCK_INFINITY" if value > 0 else "-MCK_INFINITY"
    if not single:
        return repr(float(value))
    # what single precision cannot hold becomes its largest number, not infinity
    limit = float(np.finfo(np.float32).max)
    text = str(np.float32(min(max(value, -limit), limit)))
    return f"{text if any(mark in text for mark in '.e') else text + '.0'}f"


def literals(values: Iterable[float], *, single: bool = False) -> str:
    """Return numbers as C literals, separated by commas."""
    return ", ".join(literal(float(value), single=single) for value in values)


def rows(values: Iterable[float], *, single: bool = False) -> list[str]:
    """Return lines of an initialiser, each ending in a comma."""
    lines = textwrap.wrap(literals(values, single=single), WIDTH, break_on_hyphens=False)
    return [f"{line.rstrip(',')}," for line in lines]


def wrapped(line: str) -> list[str]:
    """Return a line of C wrapped to the line length; types stay with their names."""
    indent = " " * (len(line) - len(line.lstrip()) + 8)
    line = re.sub(r"(const|mck_real|int) (?=\*?\w)", "\\1\u00a0", line)
    lines = textwrap.wrap(line, CODE_WIDTH, subsequent_indent=indent, break_on_hyphens=False)
    return [each.replace("\u00a0", " ") for each in lines]
