"""What a fitted model is used as: itself, a compensator of one kind or another, an estimate of force."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mckibben.errors import MckibbenError, ModelError

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.app.workspace import Workspace
    from mckibben.blocks.base import Block

FORMS = {
    "model": "the model itself, as fitted",
    "inverse": "its compensator: the inverse, exact for this model",
    "adaptive": "a compensator that learns while it runs",
    "predictive": "a compensator that looks ahead, for slow valves and limits",
    "force": "its estimate of force, from motion and pressure",
    "band": "the model with its band of uncertainty",
}
"""What a model is used as, in words."""

COMPENSATORS = ("inverse", "adaptive", "predictive")

SETTINGS = {
    "adaptive": {"time": "How long it takes to learn [s]"},
    "predictive": {
        "rate_limit": "Fastest change of a pressure [bar/s]",
        "horizon": "Samples it looks ahead",
    },
}
"""Settings of what a model is used as, with what they mean."""

STEP = 0.02
"""Time between steps, where the model has none of its own [s]."""

DEFAULTS: dict[str, float | None] = {"time": 60.0, "rate_limit": None, "horizon": 20.0}


def inverse_of(block: Block) -> Block:
    """Return the compensator of a model: its inverse, or of a force in closed form.

    Raises
    ------
    ModelError
        If it has none, or is one already.
    """
    from mckibben.blocks.force.feedforward import compensator
    from mckibben.blocks.inverse import drives

    if drives(block.outputs[0]) or (block.undoing and not drives(block.inputs[0])):
        raise ModelError("it is a compensator already", remedy="choose the model that it undoes")
    return compensator(block)


def force_of(block: Block) -> Block:
    """Return what tells a force from what is measured: the model itself where it gives one.

    Raises
    ------
    ModelError
        If the model tells none.
    """
    from mckibben.blocks.coupled.load_estimate import load_of

    if all(channel.name.startswith("force") for channel in block.outputs):
        return block
    return load_of(block)


def made(workspace: Workspace, name: str, form: str, settings: Mapping[str, Any]) -> Block:
    """Return a model of the workspace as what it is to be used as.

    Parameters
    ----------
    workspace : Workspace
    name : str
        Of the model.
    form : str
        One of `FORMS`.
    settings : mapping
        Those of `SETTINGS`; what is None is at its default.

    Raises
    ------
    MckibbenError
        If the model cannot be that, or there is no such model.
    """
    if form == "band":
        return workspace.model(name, "banded")
    block = workspace.model(name)
    given = _options(form, settings)
    match form:
        case "model":
            return block
        case "inverse":
            return inverse_of(block)
        case "force":
            return force_of(block)
        case "adaptive" | "predictive":
            from mckibben.workflow import invert

            if form == "predictive" and "horizon" in given:
                given["horizon"] = int(given["horizon"])
            return invert(
                block, adaptive=form == "adaptive", predictive=form == "predictive", **given
            ).block
    raise ModelError(
        f"{form!r:.40} is no use of a model", remedy=f"choose one of {', '.join(FORMS)}"
    )


def _options(form: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a use; what is None is at its default."""
    given = DEFAULTS | {key: value for key, value in settings.items() if value is not None}
    return {key: v for key in SETTINGS.get(form, ()) if (v := given[key]) is not None}


def possible(workspace: Workspace, name: str) -> list[str]:
    """Return what a model can be used as, of `FORMS`; trying takes a moment."""
    found = []
    for form in FORMS:
        if form == "band" and not workspace.path("banded", f"{name}.json").exists():
            continue
        try:
            block = made(workspace, name, form, {})
        except MckibbenError:
            continue
        if form != "force" or block is not workspace.model(name):
            found.append(form)
    return found


def written(workspace: Workspace, name: str, form: str, settings: Mapping[str, Any]) -> str:
    """Return the call that gives a model as what it is used as; what makes its file stands before."""
    from mckibben.blocks.force.feedforward import ForceFeedforward

    options = _options(form, settings)
    flags = "".join(f" --{key.replace('_', '-')} {value:g}" for key, value in options.items())
    asked = {
        "inverse": "",
        "adaptive": " --adaptive",
        "predictive": " --predictive",
        "force": " --for force",
    }
    if form == "band":
        return f"mckibben.load('banded/{name}.json')"
    if form not in asked:
        return f"mckibben.load('models/{name}.json')"
    if form == "inverse" and ForceFeedforward.of(workspace.model(name)) is None:
        return f"mckibben.load('models/{name}.json').inverse()"
    made = f"{name}-{form}.json"
    invert = in_a_shell(f"mckibben invert models/{name}.json{asked[form]}{flags} -o {made}")
    return f"{invert}\nmckibben.load({made!r})"


def in_python(block: Block, form: str, settings: Mapping[str, Any]) -> list[str]:
    """Return the lines that make of ``model`` its compensator, ``inverse``."""
    from mckibben.blocks.force.feedforward import ForceFeedforward

    given = "".join(f", {key}={value:g}" for key, value in _options(form, settings).items())
    if form == "inverse" and ForceFeedforward.of(block) is None:
        return ["inverse = model.inverse()"]
    where, name, asked = {
        "adaptive": ("adaptive", "adaptive", "(model"),
        "predictive": ("predictive", "Predictive", "(model.inverse()"),
        "inverse": ("force.feedforward", "ForceFeedforward", ".of(model"),
    }[form]
    return [f"from mckibben.blocks.{where} import {name}", "", f"inverse = {name}{asked}{given})"]


def in_a_shell(command: str) -> str:
    """Return a command as a comment among calls."""
    return f"# in a shell: {command}"
