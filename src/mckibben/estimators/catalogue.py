"""Catalogue of the available models and their settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from mckibben import registry
from mckibben.errors import ModelError
from mckibben.estimators.core.estimator import Estimator, Purpose
from mckibben.hints import FORMER_SETTINGS, former


@dataclass(frozen=True)
class Need:
    """Purpose of a group of models.

    Parameters
    ----------
    title : str
        In a few words.
    about : str
        In a sentence.
    models : tuple of str
        Short names: those tried first, then the others, each by what a fit costs.
    """

    title: str
    about: str
    models: tuple[str, ...]


NEEDS: dict[Purpose | None, tuple[str, str]] = {
    "memory": (
        "Hysteresis of one muscle",
        "Rate-independent hysteresis, pressure to displacement.",
    ),
    "rate": (
        "Dynamics: lag, creep and rate dependence",
        "The response depends on speed, or continues while pressure is constant.",
    ),
    "several": ("Several muscles and loads", "Coupled muscles, or a muscle under a varying load."),
    "force": (
        "Force and activation pressure",
        "Force from pressure and length, or pressure from a desired contraction under a force.",
    ),
    None: ("Others", "Models that other packages bring."),
}
"""Title and sentence of every purpose, as listed."""


def needs() -> tuple[Need, ...]:
    """Return all models by purpose."""
    models = {name: declared(name) for name in registry.names("estimators")}
    usual = sorted(models, key=lambda name: (not models[name].quick, models[name].effort, name))
    groups = {
        purpose: tuple(name for name in usual if models[name].purpose == purpose)
        for purpose in NEEDS
    }
    return tuple(Need(*NEEDS[purpose], names) for purpose, names in groups.items() if names)


def declared(model: str) -> type[Estimator]:
    """Return the estimator class of a model; defaults if it cannot be loaded."""
    try:
        estimator: type[Estimator] = registry.load("estimators", model)
    except ModelError:
        return Estimator
    return estimator


def full_name(model: str) -> str:
    """Return a model's full name, or its short one.

    >>> full_name("pi"), full_name("mine")
    ('Prandtl–Ishlinskii model (PI)', 'mine')
    """
    return declared(model).title or model


def ability(model: str) -> str:
    """Return what a model represents, in one sentence."""
    estimator = declared(model)
    return estimator.can or (estimator.__doc__ or "").strip().partition("\n")[0]


def summary(model: str) -> str:
    """Return a model's full name and what it represents.

    >>> summary("arx")
    'ARX model, linear. Linear dynamics, in closed form.'
    """
    return f"{full_name(model)}. {ability(model)}"


def defaults(model: str) -> dict[str, Any]:
    """Return the settings of a model's estimator with their defaults."""
    settings: dict[str, Any] = registry.load("estimators", model)().get_params()
    return settings


def described() -> dict[str, Any]:
    """Return the description of every model, and its settings."""
    names = registry.names("estimators")
    return {name: {"summary": summary(name), "settings": defaults(name)} for name in names}


def settings_of(model: str, stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of one model's estimator; see `settings_of_all`."""
    return settings_of_all({model: registry.load("estimators", model)}, stated)[model]


def settings_of_all(
    estimators: Mapping[str, type[Estimator]], stated: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return the settings of several models, checked against their declarations.

    Parameters
    ----------
    estimators : mapping of str to type
        By short name, or another label.
    given : mapping
        ``NAME`` -> value, of all models that have it; ``MODEL.NAME`` -> value; or ``MODEL`` -> settings.

    Raises
    ------
    ModelError
        If no model has one of the settings, or it may not have that value.
    """
    names_of = {name: [one.name for one in fields(each)] for name, each in estimators.items()}
    result: dict[str, dict[str, Any]] = {name: {} for name in estimators}
    flat = {
        name: value
        for key, one in stated.items()
        for name, value in (
            {f"{key}.{k}": v for k, v in one.items()} if isinstance(one, Mapping) else {key: one}
        ).items()
    }
    for key, value in flat.items():
        owner, dot, name = key.replace("-", "_").rpartition(".")
        takers = [
            model
            for model in estimators
            if name in names_of[model] and (not dot or owner == model.replace("-", "_"))
        ]
        if not takers:
            all_names = sorted({setting for some in names_of.values() for setting in some})
            hints = (former([model], name, FORMER_SETTINGS) for model in estimators)
            raise ModelError(
                f"{', '.join(estimators)} has no such setting",
                parameter=key,
                remedy=next(
                    filter(None, hints), f"give one, or MODEL.NAME, of {', '.join(all_names)}"
                ),
            )
        for model in takers:
            result[model][name] = value
    for model, settings in result.items():
        if settings:  # now, and not when this model's turn has come
            estimators[model](**settings).check_settings()
    return result
