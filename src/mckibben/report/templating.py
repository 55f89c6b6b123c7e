"""The page templates, set up the same way for every report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.report import wording

if TYPE_CHECKING:
    from jinja2 import Template


def template(name: str) -> Template:
    """Return a template: everything escaped, nothing undefined, numbers as they are printed."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("mckibben.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": wording.number, "percent": wording.percent}
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    return environment.get_template(name)
