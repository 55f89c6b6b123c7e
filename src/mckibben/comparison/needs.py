"""The models by what one needs them for: ``needs.toml`` beside has an entry a model."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from mckibben import registry
from mckibben.comparison.inverses import Kind


@dataclass(frozen=True)
class Need:
    """What some models are for.

    Parameters
    ----------
    title : str
        In a few words.
    about : str
        In a sentence.
    models : dict of str to str
        Short names and full names, the usual ones first.
    start : tuple of str
        Those to begin with.
    """

    title: str
    about: str
    models: dict[str, str]
    start: tuple[str, ...] = ()


@cache
def _read() -> dict[str, Any]:
    return tomllib.loads(files("mckibben.comparison").joinpath("needs.toml").read_text("utf-8"))


def needs() -> tuple[Need, ...]:
    """Return all models by what they are for; those that nothing is said of come last."""
    said = [
        Need(one["title"], one["about"], dict(one["models"]), tuple(one["start"]))
        for one in _read().values()
        if "models" in one
    ]
    known = {model for need in said for model in need.models}
    others = {name: name for name in registry.names("estimators") if name not in known}
    if others:
        said.append(Need("Others", "Models that other packages bring.", others))
    return tuple(said)


def full_name(model: str) -> str:
    """Return a model's full name, or its short one where no other is known.

    >>> full_name("pi"), full_name("mine")
    ('Prandtl–Ishlinskii model (PI)', 'mine')
    """
    return next((need.models[model] for need in needs() if model in need.models), model)


def inverse_kind(model: str) -> Kind:
    """Return how models of a kind are undone as a rule; a fitted one may be no good for it.

    >>> inverse_kind("gpi"), inverse_kind("eupi"), inverse_kind("narx")
    ('exact', 'solved', 'none')
    """
    kinds: tuple[Kind, ...] = ("exact", "solved")
    return next((kind for kind in kinds if model in _read()["inverse"][kind]), "none")


def inverse_may_lack(model: str) -> bool:
    """Tell whether it depends on the fit that a model can be undone: a filter's inverse may be unstable.

    >>> inverse_may_lack("arx"), inverse_may_lack("pi")
    (True, False)
    """
    return model in _read()["inverse"]["where_stable"]
