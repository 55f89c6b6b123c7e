"""Plan of the next recording: random motion within limits, and runs that close data gaps.

With a model, the standard errors that its parameters should have are given: those of least squares of
the free run where residuals are correlated, of all recordings and the plan together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.equations import quantities
from mckibben.blocks.running import run_many
from mckibben.diagnosis.data_gaps import Gap, excitation, gaps_of
from mckibben.diagnosis.excitation import Excitation
from mckibben.errors import DataError, MckibbenError, ModelError, require
from mckibben.estimators.catalogue import default_model
from mckibben.estimators.core.uncertainty import (
    LARGEST,
    autoregressions,
    relative_sizes,
    sandwich,
    sensitivities,
    vanishing,
)
from mckibben.muscles.library import list as all_muscles
from mckibben.muscles.library import load
from mckibben.muscles.prior import prior_of
from mckibben.muscles.scaling import scaled
from mckibben.planning.limits import (
    CROSSING,
    Limit,
    Limits,
    check_possible,
    limits_of_recordings,
    limits_of_rig,
    narrowed,
)
from mckibben.planning.motion import motion
from mckibben.recording import Recording, listed, sample_time_of
from mckibben.rigs import Rig, load_rig
from mckibben.signals.checking import generator
from mckibben.statistics import Autoregression
from mckibben.system.threads import one_blas_thread

MOST_MINUTES = 60.0
"""Longest plan [min]; a longer one is better made in two."""

MOST_VALUES = 2e7
"""Sensitivities that are computed at once, of all samples to all parameters."""

NOISE = 0.003
"""Assumed noise of an output, relative to its range, without recordings."""

LOADED = 0.3
"""Load of a muscle, as a share of its largest force, if no load is known."""

USUAL = 0.02
"""Sample time of a plan without recordings [s]."""


@dataclass(frozen=True)
class Parameter:
    """A parameter with its relative standard errors, now and with the plan; None if unknown."""

    name: str
    value: float
    now: float | None
    after: float | None


@dataclass(frozen=True)
class Step:
    """A part of a plan: start and stop [s], kind of motion, and the data gaps it closes."""

    start: float
    stop: float
    what: str
    gaps: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """Plan of the next recording: commands over time, and the purpose of each part.

    Parameters
    ----------
    recording : Recording
    steps : tuple of Step
    parameters : tuple of Parameter
        Of the model; empty without one.
    gaps : tuple of Gap
        What the recordings so far cannot identify.
    extrapolated : tuple of str
        Channels that go beyond the recordings.
    """

    recording: Recording
    steps: tuple[Step, ...] = field(repr=False)
    parameters: tuple[Parameter, ...] = field(default=(), repr=False)
    gaps: tuple[Gap, ...] = field(default=(), repr=False)
    extrapolated: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all but the samples, for JSON."""
        return {
            "seconds": self.recording.duration,
            "parameters": [vars(one) for one in self.parameters],
            "steps": [vars(one) for one in self.steps],
            "gaps": [one.to_dict() for one in self.gaps],
            "extrapolated": list(self.extrapolated),
            "start": {name: float(v[0]) for name, v in self.recording.channels.items()},
        }


def plan(
    recordings: Recording | Sequence[Recording] = (),
    *,
    rig: str | Path | Rig | None = None,
    muscle: str | Path | None = None,
    model: str | Block | None = None,
    minutes: float = 3.0,
    limits: Mapping[str, Sequence[float | None]] | None = None,
    seed: int = 0,
) -> Plan:
    """Return a plan of the next recording.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What there is: from it are limits, data gaps and, with a model, standard errors.
    rig : str, path or Rig, optional
        That is to be driven: its channels and limits.
    muscle : str or path, optional
        A muscle of the library, or a data sheet (.toml), in place of recordings.
    model : str or Block, optional
        Model whose standard errors are planned, to be fitted or fitted already; default ``balance``
        where it applies, or ``multistate`` where force is measured.
    minutes : float
        How long to record.
    limits : mapping of str to sequence of float, optional
        By channel its lowest and highest command and its rate a second; None for what stays as it is.
        Default those of the rig, or those of the recordings.
    seed : int
        Of the random motion.

    Raises
    ------
    DataError, ModelError
        On limits in which nothing moves, or what does not fit together or run free.
    """
    recorded, seconds = listed(recordings), 60 * minutes
    if (muscle is not None and recorded) or not (recorded or rig is not None or muscle is not None):
        raise DataError(
            "a plan is from recordings, or from a rig, a muscle or both",
            remedy="give files, `rig` or `muscle`, but no `muscle` with files",
        )
    if muscle is not None and model is not None:
        raise DataError("a muscle is a model itself", remedy="leave `model` out")
    possible = 0 < minutes <= MOST_MINUTES
    require(possible, "minutes", minutes, f"3, or up to {MOST_MINUTES:g}", DataError)
    generator(seed)  # refuses what is no seed
    plant = rig if isinstance(rig, Rig) or rig is None else load_rig(rig)
    block = inside(model) if isinstance(model, Block) else None
    name = model if isinstance(model, str) else None
    own = {} if plant is None else limits_of_rig(plant)
    recorded_limits: Limits = {}
    gaps: tuple[Gap, ...] = ()
    wanted = {"holds", "repeats"}
    step = USUAL if plant is None else plant.sample_time
    if recorded:
        known = _known(recorded, plant, block)
        gaps, recorded_limits = gaps_of(known), limits_of_recordings(known)
        own, wanted = recorded_limits | own, {"repeats", *(gap.run for gap in gaps)}
        step = max(step if plant else 0.0, min(one.sample_time or step for one in recorded))
    elif muscle is not None:
        block, own = _of_muscle(muscle, plant)
    if block is not None and block.sample_time is not None:
        step = block.sample_time
    within = narrowed(own, limits or {})
    check_possible(within, seconds, plant)
    with one_blas_thread():
        parts = motion(within, seconds, step, wanted, np.random.default_rng(seed))
        commands = np.concatenate([part for _, part in parts])
        planned = Recording(dict(zip(within, commands.T, strict=True)), step)
        if plant is not None and block is None and not recorded:
            parameters = _of_twin(plant, name, planned, seed)
        else:
            block = block or _fitted(_known(recorded, plant, None), name, seed)
            parameters = () if block is None else _parameters(block, recorded, planned)
    return Plan(
        planned if plant is None else planned.select(plant.inputs),
        _steps(parts, step, gaps),
        parameters,
        gaps,
        tuple(name for name, limit in within.items() if limit.beyond(recorded_limits.get(name))),
    )


def _steps(
    parts: Sequence[tuple[str, Array]], step: float, gaps: Sequence[Gap]
) -> tuple[Step, ...]:
    """Return the purpose and the times of each part."""
    found, start = [], 0.0
    for what, group in groupby(parts, key=lambda part: part[0]):
        stop = start + step * sum(len(commands) for _, commands in group)
        runs = ("random", "speeds") if what == "random" else (what,)
        closed = tuple(gap.what for gap in gaps if gap.run in runs)
        found.append(Step(round(start, 9), round(stop, 9), what, closed))
        start = stop
    return tuple(found)


def _known(recordings: list[Recording], rig: Rig | None, block: Block | None) -> Excitation:
    """Return the excitation of recordings, with the channels of a model if one is given."""
    needed = [*(rig.inputs if rig is not None else ())]
    needed += [one.name for one in (*block.inputs, *block.outputs)] if block is not None else []
    for recording in recordings:
        sample_time_of(recording, "be planned from")
        if lacking := [name for name in needed if name not in recording]:
            raise DataError(
                f"the recording lacks {', '.join(lacking)}, which the rig or the model has",
                file=recording.source,
                remedy="give recordings of this rig and model, or leave `rig` or `model` out",
            )
    if block is None:
        return excitation(recordings, None if rig is None else rig.inputs)
    driven = [one.name for one in block.inputs]
    if rig is not None and not {*driven} & {*rig.inputs}:
        raise DataError(
            f"the model is driven by {', '.join(driven)}, and the rig by {', '.join(rig.inputs)}",
            remedy="give a model of the rig's own inputs, or leave `model` out",
        )
    known = excitation(recordings, driven, [one.name for one in block.outputs])
    return replace(known, loads=tuple(name for name in known.loads if name in driven))


def _of_twin(rig: Rig, model: str | None, planned: Recording, seed: int) -> tuple[Parameter, ...]:
    """Return the parameters of a model fitted to the plan as recorded by a rig, without earlier data."""
    resting = rig.changed({f"start.{name}": float(u[0]) for name, u in planned.channels.items()})
    recorded = [resting.run(planned, seed)]
    block = _fitted(_known(recorded, rig, None), model, seed)
    found = () if block is None else _parameters(block, recorded, planned)
    return tuple(replace(one, now=None, after=one.now) for one in found)


def _fitted(known: Excitation, model: str | None, seed: int) -> Block | None:
    """Return a model fitted to recordings; None if the default model does not apply."""
    usual = "plan of force" if known.outputs == ("force",) else "plan of displacement"
    kind = registry.load("estimators", model or default_model(usual))  # type: ignore[arg-type]
    channels = known.inputs, known.outputs, known.loads or None
    if model is None and kind.objection(list(known.recordings), *channels) is not None:
        return None
    settings = kind.channel_settings(*channels)
    try:
        block: Block = kind(**settings, seed=seed).fit(list(known.recordings)).model_
    except MckibbenError:
        if model is not None:
            raise
        return None
    return block


def _of_muscle(given: str | Path, rig: Rig | None) -> tuple[Block, Limits]:
    """Return the model of the most similar muscle of the library, and its driving channels."""
    sheet = prior_of(given).sheet
    if Path(given).suffix != ".toml":
        like = load(given)
    else:
        muscles = [one for one in all_muscles() if one.name not in (sheet.without or ())]
        like = min(muscles, key=lambda one: float(np.sum((one.sheet.shape - sheet.shape) ** 2)))
    block = scaled(like.balance, like.sheet, sheet).inverse()
    limits = {} if rig is None else limits_of_rig(rig)
    highest = {"bar": sheet.max_pressure_bar, "N": LOADED * sheet.force}
    for channel in block.inputs:
        if rig is not None and channel.unit == "N" and channel.name not in limits:
            hung = 9.81 * float(rig.known().get("payload_kg", 0.0))
            limits[channel.name] = Limit(hung, hung, 1.0, hung)
        elif rig is None and channel.unit in highest:
            high = highest[channel.unit]
            limits[channel.name] = Limit(0.0, high, high / CROSSING, 0.0)
        elif channel.name not in limits:
            raise ModelError(
                f"{like.name!r} is driven by {channel.name}, which is unknown here",
                remedy="plan from recordings",
            )
    return block, limits


def _parameters(
    block: Block, recordings: Sequence[Recording], planned: Recording
) -> tuple[Parameter, ...]:
    """Return the parameters of a model with their standard errors, now and with the plan."""
    values, names = block.pack(), quantities(block)
    places = np.flatnonzero(np.logical_not(vanishing(values))).tolist()
    if not places:
        return ()
    sizes = relative_sizes(values)[places]
    inputs, outputs = ([one.name for one in each] for each in (block.inputs, block.outputs))
    total = sum(map(len, recordings)) * len(places) * len(outputs)
    share = min(1.0, MOST_VALUES / max(total, 1))  # the beginnings stand for the whole
    kept = [one.slice(0, max(int(share * len(one)), 2)) for one in recordings]

    def slopes(recording: Recording) -> Array:
        """Return the derivatives of outputs by parameters, shape (n, outputs, parameters)."""

        def run(blocks: list[Block]) -> Array:
            given, step = recording.matrix(inputs), recording.sample_time
            return run_many(blocks, given, sample_time=step).reshape(len(blocks), -1)

        with np.errstate(over="ignore", invalid="ignore"):
            flat = sensitivities(block, places, sizes, run)
        if not (np.abs(flat) < LARGEST).all():
            raise ModelError(
                f"{block.kind!r} does not run free within these limits",
                remedy="identify it again, or plan with another `model`",
            )
        return flat.reshape(len(recording), len(outputs), -1)

    left = [one.matrix(outputs) - block.simulate(one).matrix(outputs) for one in kept]
    moves = [slopes(one) / np.sqrt(share) for one in kept]
    if left:
        noise = autoregressions(left)
    else:
        spans = np.ptp(block.simulate(planned).matrix(outputs), axis=0)
        noise = [Autoregression(np.zeros(0), x, x * x) for x in (NOISE * spans).tolist()]

    def errors(moves: list[Array], left: list[Array]) -> list[float | None]:
        """Return relative standard errors; None for undetermined parameters."""
        if not moves:
            return [None] * len(places)
        _, covariance, determined = sandwich(moves, left, noise)
        found = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * sizes / np.abs(values[places])
        return [x if known else None for x, known in zip(found.tolist(), determined, strict=True)]

    now = errors(moves, left)
    after = errors([*moves, slopes(planned)], [*left, np.zeros((len(planned), len(outputs)))])
    return tuple(
        Parameter(names[place].name, float(values[place]), *both)
        for place, *both in zip(places, now, after, strict=True)
    )
