"""Templates of generated sources, set up the same way for C and for FMUs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

MARKUP = (".xml.j2", ".html.j2")
"""Endings of templates whose values are escaped; those of C come through `naming.said`."""


def render(package: str, template: str, content: Mapping[str, Any]) -> str:
    """Return a template of a package's folder ``templates``, filled in; nothing may be undefined."""
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
