"""The models on offer: what each is, how it can be set, and which have a place on recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any

from mckibben import registry
from mckibben.comparison.channels import Channels
from mckibben.errors import ModelError
from mckibben.estimators.core.estimator import DefaultFor, Estimator, Purpose
from mckibben.estimators.core.settings import check_settings, setting_value
from mckibben.recording import Recording


@dataclass(frozen=True)
class Need:
    """What some models are for.

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
        "Memory: loops of one muscle",
        "From where an input turned, whatever the speed: pressure to displacement.",
    ),
    "rate": (
        "Rate: lags, creep and dynamics",
        "What a muscle does depends on how fast, and goes on while pressure is held.",
    ),
    "several": (
        "Several muscles, and loads",
        "Muscles that move one another, or a muscle under a load that varies.",
    ),
    "force": (
        "Force and activation pressure",
        "Force from pressure and length, or pressure from a desired contraction under a force.",
    ),
    None: ("Others", "Models that other packages bring."),
}
"""Title and sentence of every purpose, as listed."""


def needs() -> tuple[Need, ...]:
    """Return all models by what they are for."""
    models = {name: declared(name) for name in registry.names("estimators")}
    usual = sorted(models, key=lambda name: (not models[name].quick, models[name].effort, name))
    groups = {
        purpose: tuple(name for name in usual if models[name].purpose == purpose)
        for purpose in NEEDS
    }
    return tuple(Need(*NEEDS[purpose], names) for purpose, names in groups.items() if names)


def declared(model: str) -> type[Estimator]:
    """Return the estimator on which a model declares itself; the defaults if it cannot be loaded."""
    try:
        found: type[Estimator] = registry.load("estimators", model)
    except ModelError:
        return Estimator
    return found


def full_name(model: str) -> str:
    """Return a model's full name, or its short one where no other is known.

    >>> full_name("pi"), full_name("mine")
    ('Prandtl–Ishlinskii model (PI)', 'mine')
    """
    return declared(model).title or model


def caution(model: str) -> str | None:
    """Return why a model is good only near what it was trained on, or None where nothing says so.

    A model that interpolates well may lead every ranking on motions like those of its training, and be
    far off elsewhere: that is told beside its errors.

    >>> caution("gpi") is None, caution("narx")
    (True, 'a polynomial of past values leaves all bounds beyond them')
    """
    return declared(model).caution


def ability(model: str) -> str:
    """Return what a model represents, in a sentence."""
    known = declared(model)
    return known.can or (known.__doc__ or "").strip().partition("\n")[0]


def summary(model: str) -> str:
    """Return a model's full name and what it represents.

    >>> summary("arx")
    'ARX model, linear. Linear dynamics, in closed form.'
    """
    return f"{full_name(model)}. {ability(model)}"


def default_model(use: DefaultFor) -> str:
    """Return the model that is used somewhere without being named.

    >>> default_model("load")
    'mpi'
    """
    return next(n for n in registry.names("estimators") if declared(n).default_for == use)


def defaults(model: str) -> dict[str, Any]:
    """Return the settings of a model's estimator that have a default, and that."""
    known = fields(registry.load("estimators", model))
    return {field.name: field.default for field in known if field.default is not MISSING}


def objections(
    models: Iterable[str], recordings: Sequence[Recording], channels: Channels
) -> dict[str, str]:
    """Return which of some models have no place on channels of recordings, and why."""
    asked = recordings, channels.inputs, channels.outputs, channels.scheduling
    found: dict[str, str] = {}
    for name in models:
        try:
            estimator = registry.load("estimators", name)
            reason = estimator.objection(*asked) or _timeless(estimator, recordings)
        except ModelError as error:  # a plug-in that is broken is not the end of all others
            reason = str(error)
        if reason is not None:
            found[name] = reason
    return found


def _timeless(estimator: type[Estimator], recordings: Sequence[Recording]) -> str | None:
    """Return which recordings lack the time that a model needs, or None."""
    missing = [each.name for each in recordings if each.sample_time is None]
    if not (missing and estimator.needs_time):
        return None
    more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    return f"it needs time, and {missing[0]}{more} has none: give a rate, or a column of times"


def settings_of(model: str, written: Iterable[str]) -> dict[str, Any]:
    """Return the settings of one model's estimator, checked against those it has.

    Parameters
    ----------
    model : str
        Short name.
    written : iterable of str
        As ``NAME=VALUE``, values as JSON where they are that, else as words; as ``MODEL.NAME=VALUE``
        for that model only.

    Raises
    ------
    ModelError
        If there is no such setting, or it may not be that.
    """
    estimator = registry.load("estimators", model)
    known = sorted(field.name for field in fields(estimator))
    settings: dict[str, Any] = {}
    for item in written:
        owner, name = _parted(item)
        if owner not in (None, model):
            raise ModelError(
                f"{item!r} is of {owner}, and this is {model}. Remedy: leave it out, or mend the name."
            )
        _, equals, text = item.partition("=")
        if not equals or name not in known:
            raise ModelError(
                f"{item!r}: {model!r} has no setting {name!r}. Remedy: use one of {', '.join(known)}."
            )
        settings[name] = setting_value(text.strip())
    if settings:  # now, and not when this model's turn has come
        check_settings(estimator(**settings))
    return settings


def settings_of_all(models: Iterable[str], written: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the settings of several models; a bare setting goes to the models that have it.

    Raises
    ------
    ModelError
        If no model has one of the settings, or it may not be that.
    """
    names = list(models)
    known = {
        name: {field.name for field in fields(registry.load("estimators", name))} for name in names
    }
    takers: dict[str, list[str]] = {}
    for item in written:
        owner, name = _parted(item)
        takers[item] = [
            model for model in names if owner == model or (owner is None and name in known[model])
        ]
        if not takers[item]:
            raise ModelError(
                f"{item!r}: none of the models {', '.join(names)} has that setting. "
                "Remedy: see mckibben info --models."
            )
    return {
        model: settings_of(model, [item for item in written if model in takers[item]])
        for model in names
    }


def _parted(item: str) -> tuple[str | None, str]:
    """Return whose setting it is, if that is said, and its name."""
    owner, dot, name = item.partition("=")[0].strip().rpartition(".")
    return (owner if dot else None), name.replace("-", "_")
