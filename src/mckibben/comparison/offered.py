"""The models on offer: what each is, how it can be set, and which have a place on recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import MISSING, fields
from typing import Any

from mckibben import registry
from mckibben.comparison.channels import Channels
from mckibben.comparison.limits import limits
from mckibben.comparison.needs import full_name
from mckibben.errors import ModelError
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.core.settings import check_settings, setting_value
from mckibben.recording import Recording


def summary(model: str) -> str:
    """Return a model's full name and what it can represent; of others' models, what they say.

    >>> summary("arx")
    'ARX model, linear. Linear dynamics, in closed form.'
    """
    if known := limits().get(model):
        return f"{full_name(model)}. {known['can']}"
    said: str = registry.load("estimators", model).__doc__.strip().splitlines()[0]
    return said


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
