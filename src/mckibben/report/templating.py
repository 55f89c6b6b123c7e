"""The pages, set up alike for every report: they run their own scripts and ask nobody anything."""

from __future__ import annotations

import base64
import hashlib
import lzma
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from mckibben.numerals import number, percent, typeset, typeset_within
from mckibben.report import interactive
from mckibben.report.mathematics import mathml

if TYPE_CHECKING:
    from jinja2 import Environment, Template


PLOTLY = "plotly-basic.min.js.xz"
"""plotly.js 4.1.1 as published (plotly.js-basic-dist-min, MIT), packed: in Python 60 MB."""


def page(name: str, figures: dict[str, Any], **about: Any) -> str:
    """Return a page that opens without a network, and under which a browser runs nothing else.

    Parameters
    ----------
    name : str
        Of the template.
    figures : dict of str to list
        Figure -> variants -> its plots side by side.
    **about
        What else the template names.
    """
    scripts = _scripts()
    return template(name).render(
        figures=figures,
        bar=interactive.BAR,
        scripts=scripts,
        policy=policy(*scripts),
        **about,
    )


@cache
def _scripts() -> tuple[str, ...]:
    """Return what a page runs."""
    folder = resources.files("mckibben.report").joinpath("templates")
    packed = folder.joinpath(PLOTLY).read_bytes()
    return lzma.decompress(packed).decode(), folder.joinpath("report.js").read_text("utf-8")


def policy(*scripts: str) -> str:
    """Return a page's content security policy: these scripts run, and nothing is fetched or sent."""
    own = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in scripts
    )
    return (
        f"default-src 'none'; script-src {own}; style-src 'unsafe-inline'; img-src data: blob:; "
        "connect-src 'none'; form-action 'none'; base-uri 'none'"
    )


def template(name: str) -> Template:
    """Return a template: everything escaped, nothing undefined, numbers as they are printed."""
    return _environment().get_template(name)


@cache
def _environment() -> Environment:
    """Return where templates are compiled, each once for all pages."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("mckibben.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number,
        "percent": percent,
        "typeset": typeset,
        "typeset_within": typeset_within,
        "mathml": mathml,
    }
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    return environment


def versions() -> dict[str, str]:
    """Return the versions of Python, this package, and those that its numbers come from."""
    import platform
    from importlib.metadata import version

    packages = ("mckibben", "numpy", "scipy", "numba")
    return {"Python": platform.python_version()} | {name: version(name) for name in packages}
