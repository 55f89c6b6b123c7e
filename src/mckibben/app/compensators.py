"""Uses of a model: itself, its inverses and its estimate of force, for pages and jobs.

An inverse takes seconds to make and to test, so what is made of a model is cached with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from mckibben.app.workspace import Workspace
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, drives
from mckibben.errors import MckibbenError, ModelError

if TYPE_CHECKING:
    from mckibben.simulation import Simulation

KINDS = {
    "inverse": "Inverse, exact for this model",
    "adaptive": "Inverse that learns while it runs",
    "predictive": "Looks ahead, for limits and slow valves",
    "learned": "Network, trained on the recordings",
}
"""Compensators, in words."""

USES = {
    "model": "The model itself, as fitted",
    **KINDS,
    "force": "Its estimate of force",
}
"""All that a model can be used as, in words."""

SETTINGS = {
    "adaptive": ("time", "noise"),
    "predictive": ("horizon", "rate_limit", "pressures"),
}
"""Fields of `InvertOptions`, by the compensator that they are of."""


def block_for_use(workspace: Workspace, name: str, use: str, settings: Mapping[str, Any]) -> Block:
    """Return a model of the folder as one of `USES`; `ModelError` if it cannot be that."""
    from mckibben.workflow import invert

    if use == "model":
        return workspace.model(name)
    block, settings_of_use = workspace.model(name), dict(settings)
    if use == "force":
        settings_of_use = {"wanted": "force"}
    elif drives(block.outputs[0]) or (block.inverts and not drives(block.inputs[0])):
        raise ModelError("it is a compensator already", remedy="choose the model that it undoes")
    elif use == "learned":
        names = [channel.name for channel in (*block.inputs, *block.outputs)]
        settings_of_use = {
            "learned": tuple(run.select(names) for run in workspace.with_role("train"))
        }
    elif use != "inverse":
        settings_of_use[use] = True
    return invert(block, **settings_of_use).model


def cached_of_model(workspace: Workspace, name: str, key: str, make: Callable[[], Any]) -> Any:
    """Return what is made of a model, once."""
    return workspace.cached(workspace.path("models", f"{name}.json"), key, make)


def uses(workspace: Workspace, name: str) -> dict[str, str]:
    """Return what a model can be used as, in words; the first time takes a moment."""
    from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork

    def is_possible(use: str) -> bool:
        with suppress(MckibbenError):
            block = workspace.model(name)
            if use == "learned":  # training takes minutes
                return any(type(part) is FuzzyNetwork for part in getattr(block, "parts", ()))
            return bool(block_for_use(workspace, name, use, {}))
        return use == "model"

    possible = cached_of_model(workspace, name, "uses", lambda: [*filter(is_possible, USES)])
    return {use: words for use, words in USES.items() if use in possible}


def is_balance(workspace: Workspace, name: str) -> bool:
    """Return whether a model is a balance, which MJCF can carry."""
    from mckibben.blocks.coupled.balance import balance_in

    return balance_in(workspace.model(name)) is not None


def models_usable_as(workspace: Workspace, use: str) -> list[str]:
    """Return the models that can be used so; those not recommended, or on other data, are last.

    Those on other data whose channels no recording has are left out.
    """
    rows, channels = {row["name"]: row for row in workspace.results()}, {*workspace.channels()}

    def recorded_here(name: str) -> bool:
        block = workspace.model(name)
        return {channel.name for channel in (*block.inputs, *block.outputs)} <= channels

    stale = {name for name, row in rows.items() if not row["current"]}
    names = [name for name in workspace.models() if use in uses(workspace, name)]
    names = [name for name in names if name not in stale or recorded_here(name)]
    doubtful = stale | {name for name, row in rows.items() if row.get("not_recommended")}
    return sorted(names, key=lambda name: name in doubtful)


def estimate_force(workspace: Workspace, name: str, recording: str) -> Simulation:
    """Return what a model estimates of a force over a recording."""
    from mckibben.studying.simulating import simulate_recording

    block, run = block_for_use(workspace, name, "force", {}), workspace.recording(recording)
    return simulate_recording(block, lambda names: [run.select(names)])


def reference_channels(
    workspace: Workspace, name: str
) -> tuple[dict[str, Channel], dict[str, Channel]]:
    """Return the channels of a reference, and those that are held meanwhile, such as a load."""

    def make() -> Any:
        block = block_for_use(workspace, name, "inverse", {})
        channels = {channel.name: channel for channel in block.inputs}
        held = {key: channels.pop(key) for key in block.scheduling if key in channels}
        return channels, held

    channels, held = cached_of_model(workspace, name, "asked", make)
    return channels, held
