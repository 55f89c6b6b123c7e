"""What is believed before a plan: a model, what of it is known, and what may be driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.comparison.shared_rows import check_shared
from mckibben.errors import DataError, ModelError
from mckibben.estimators.catalogue import default_model
from mckibben.excitation.candidates import random_plan
from mckibben.excitation.limits import (
    Limit,
    Limits,
    followed,
    limits_of_recordings,
    limits_of_rig,
)
from mckibben.muscles.library import list as all_muscles
from mckibben.muscles.library import load
from mckibben.muscles.prior import Prior, prior_of
from mckibben.muscles.scaling import scaled
from mckibben.muscles.traits import traits
from mckibben.recording import Recording
from mckibben.rigs import Rig

MOST_PARAMETERS = 300
"""Parameters of models that plans are made with: each costs a free run."""

TWIN_TIME, TWIN_STEP = 60.0, 0.05
"""Motion of a rig as its file describes it, to which the first model is fitted [s]."""

LOADED = 0.3
"""Share of a muscle's largest pull that it is loaded with, where nobody says."""

GRAVITY = 9.81

CROSSING = 2.0
"""Time in which a muscle's pressure or load crosses its range [s]."""

STEP = 1e-5
"""Relative change of a parameter by which slopes of traits are found."""

NOTHING = 1e-10
"""Size of a parameter, over the largest, below which it is zero."""


@dataclass(frozen=True)
class Belief:
    """What is believed before a plan.

    Parameters
    ----------
    block : Block
        The likeliest model.
    limits : Limits
        Of all channels that are driven.
    recordings : sequence of Recording
        What has been recorded, of which the model is.
    prior : Prior, optional
        What the library says of the muscle.
    step : float
        Sample time of the recording to make [s].
    driven : sequence of str, optional
        Channels that can be commanded; by default all that have limits.
    notes : sequence of str
        What the user should know.
    """

    block: Block
    limits: Limits
    recordings: tuple[Recording, ...] = ()
    prior: Prior | None = None
    step: float = 0.01
    driven: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()

    def known_before(self, places: Sequence[int]) -> Array:
        """Return the precision that the library gives the parameters, in units of their sizes."""
        if self.prior is None:
            return np.zeros((len(places), len(places)))
        values, sheet = self.block.pack(), self.prior.sheet
        balance: Any = self.block.inverse()
        base = traits(balance, sheet)
        columns = []
        for place in places:
            moved = values.copy()
            moved[place] *= 1 + STEP
            columns.append((traits(balance.unpack(moved), sheet) - base) / STEP)
        slopes = self.prior.weights() @ np.nan_to_num(np.column_stack(columns))
        return np.asarray(slopes.T @ slopes)


def from_recordings(
    recordings: Sequence[Recording], model: str | Block | None, rig: Rig | None, seed: int
) -> Belief:
    """Return the belief of what has been recorded, on a rig if one is named.

    Raises
    ------
    DataError
        On recordings without time, or that do not fit the rig or the model.
    """
    for recording in recordings:
        if recording.sample_time is None:
            raise DataError(
                "the recording has no time, and a plan says how fast to go",
                file=recording.source,
                remedy="read it with a time column or --rate",
            )
    if rig is not None:
        for recording in recordings:
            lacking = [name for name in _needed(rig) if name not in recording]
            if lacking:
                raise DataError(
                    f"the recording lacks {', '.join(lacking)}, which the rig {rig.name!r} "
                    "drives or measures",
                    file=recording.source,
                    remedy="give recordings of this rig, or leave --rig out",
                )
    block = inside(model) if isinstance(model, Block) else _fitted(recordings, model, rig, seed)
    inputs = [channel.name for channel in block.inputs]
    outputs = [channel.name for channel in block.outputs]
    names = [*inputs, *outputs]
    fitting = tuple(r for r in recordings if all(name in r for name in names))
    check_shared({"plan": fitting}, inputs, outputs)
    if not fitting:
        raise DataError(
            f"no recording has all of {', '.join(names)}, which the model needs",
            file=recordings[0].source,
            remedy="give a model of these channels, or recordings with them",
        )
    driven = [channel.name for channel in block.inputs]
    step = min(float(r.sample_time or 1.0) for r in recordings)
    if rig is None:
        return Belief(block, limits_of_recordings(fitting, driven), fitting, step=step)
    return Belief(block, _of_rig(rig, driven), fitting, step=max(rig.sample_time, min(step, 0.01)))


def from_rig(rig: Rig, model: str | Block | None, asked: Limits, seed: int) -> Belief:
    """Return the belief of a rig of which nothing is recorded: what its file says is likely.

    A model is fitted to random motion of the rig as described; what that tells is not counted as known.
    """
    if isinstance(model, Block):
        block = model
    else:
        rng = np.random.default_rng(seed)
        n = round(TWIN_TIME / TWIN_STEP)
        targets = random_plan(asked, 1, n, TWIN_STEP, rng)[0].targets
        start = np.array([limit.rest for limit in asked.values()])
        commands = followed(targets, start, asked, TWIN_STEP)
        channels = dict(zip(asked, commands.T, strict=True))
        resting = rig.changed({f"start.{name}": limit.rest for name, limit in asked.items()})
        block = _fitted([resting.run(Recording(channels, TWIN_STEP), seed)], model, rig, seed)
    _of_rig(rig, [channel.name for channel in block.inputs])
    note = f"nothing is recorded: what {rig.name} says of itself is taken for likely, not for known"
    return Belief(block, asked, step=max(rig.sample_time, 0.01), notes=(note,))


def from_muscle(given: str | Path, rig: Rig | None) -> Belief:
    """Return the belief of a muscle of the library, or of a data sheet, in a rig if one is named."""
    prior = prior_of(given)
    if Path(given).suffix != ".toml":
        like = load(given)
    else:
        left_out = prior.sheet.without or ()
        muscles = [muscle for muscle in all_muscles() if muscle.name not in left_out]
        here = prior.sheet.shape
        like = min(muscles, key=lambda one: float(np.sum((one.sheet.shape - here) ** 2)))
    block = scaled(like.balance, like.sheet, prior.sheet).inverse()
    highest = {"bar": prior.sheet.max_pressure_bar, "N": LOADED * prior.sheet.force}
    limits = {} if rig is None else limits_of_rig(rig)
    driven = None if rig is None else rig.inputs
    for channel in block.inputs:
        if channel.name in limits:
            continue
        if rig is not None and channel.unit == "N":  # what hangs on it
            load_ = GRAVITY * float(rig.known().get("payload_kg", 0.0))
            limits[channel.name] = Limit(load_, load_, 1.0, load_)
        elif rig is None and channel.unit in highest:
            high = highest[channel.unit]
            limits[channel.name] = Limit(0.0, high, high / CROSSING, 0.0)
        else:
            raise ModelError(
                f"{like.name!r} is driven by {channel.name}, of which nothing is known here. "
                "Remedy: plan from recordings."
            )
    note = f"nothing is recorded: what the library says, nearest {like.name}, is taken for likely"
    return Belief(block, limits, prior=prior, driven=driven, notes=(note,))


def telling(block: Block) -> list[int]:
    """Return the places of parameters that are not zero, of a model whose free run tells of them.

    Raises
    ------
    ModelError
        On models without parameters, or with too many.
    """
    sizes = np.abs(block.pack())
    places = np.flatnonzero(sizes > NOTHING * sizes.max(initial=0.0)).tolist()
    if not places:
        raise ModelError(
            f"{block.kind!r} has no parameters that a recording could tell of. Remedy: plan with a "
            "fitted model, for instance balance."
        )
    if len(places) > MOST_PARAMETERS:
        raise ModelError(
            f"{block.kind!r} has {len(places)} parameters, more than the {MOST_PARAMETERS} that a plan "
            "can follow. Remedy: plan with a model with fewer, for instance balance."
        )
    return [int(place) for place in places]


def _needed(rig: Rig) -> list[str]:
    measured = [name for name in rig.outputs if name.startswith(("displacement", "force"))]
    return list(dict.fromkeys([*rig.inputs, *measured]))


def _of_rig(rig: Rig, driven: Sequence[str]) -> Limits:
    """Return the limits of a rig whose inputs a model has."""
    strangers = [name for name in driven if name not in rig.inputs]
    if strangers:
        raise DataError(
            f"the model is driven by {', '.join(strangers)}, and the rig {rig.name!r} by "
            f"{', '.join(rig.inputs)}",
            remedy="give a model of the rig's own inputs, or leave --model out",
        )
    return limits_of_rig(rig)


def _fitted(
    recordings: Sequence[Recording], model: str | Block | None, rig: Rig | None, seed: int
) -> Block:
    """Return a model fitted to recordings, of the rig's inputs if there is one."""
    several = {name for recording in recordings for name in recording.channels}
    moves = any(name.startswith("displacement") for name in several)
    usual = default_model("plan of displacement" if moves else "plan of force")
    estimator = registry.load("estimators", str(model or usual))(seed=seed)
    if rig is not None and rig.inputs[0] == "voltage":
        told = estimator.input
        estimator.input = "voltage" if isinstance(told, str) else ("voltage",)
    block: Block = estimator.fit(list(recordings)).model_
    return block
