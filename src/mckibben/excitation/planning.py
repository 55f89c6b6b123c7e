"""What to record next: the motion that leaves the least expected error of a model.

What is made small is the variance of free-running predictions of random motion (or of chosen
parameters), averaged over a few likely sets of parameters, given what recordings tell already.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mckibben.blocks.base import Block
from mckibben.errors import DataError, ModelError
from mckibben.excitation.believed import from_muscle, from_recordings, from_rig
from mckibben.excitation.limits import Limits, beyond, limits_of_rig, narrowed, within_hardware
from mckibben.excitation.plans import Plan
from mckibben.excitation.prospect import prospect_of
from mckibben.excitation.search import Progress, Search
from mckibben.recording import Recording, listed, standard_unit
from mckibben.rigs import Rig, load_rig
from mckibben.signals.checking import generator
from mckibben.system.progress import telling
from mckibben.system.threads import one_blas_thread

SHARE_OF_WAYS = 0.25
"""Most of the time that crossing the range once may take."""

MOST_MINUTES = 60.0
"""Longest plan: longer ones are better made after the first has been recorded."""


def plan(
    recordings: Recording | Sequence[Recording] = (),
    *,
    rig: str | Path | Rig | None = None,
    muscle: str | Path | None = None,
    model: str | Block | None = None,
    minutes: float = 3.0,
    limits: Mapping[str, Sequence[float | None]] | None = None,
    goal: str | None = None,
    seed: int = 0,
    progress: bool | Progress | None = None,
) -> Plan:
    """Return what to record next.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What there is, to which a model is fitted and from which it is known what they tell.
    rig : str, path or Rig, optional
        That is to be driven: its channels and limits. Without recordings, what it says of itself is
        taken for likely, but where there is a muscle.
    muscle : str or path, optional
        A muscle of the library, or a data sheet (.toml), in place of recordings.
    model : str or Block, optional
        What is fitted, or has been; default ``balance``, or ``multistate`` where force is measured.
    minutes : float
        How long to record.
    limits : mapping of str to sequence of float, optional
        By channel its lowest and highest command and, in its unit a second, its rate; None for what
        stays as it is. Default those of the rig, or those of the recordings.
    goal : str, optional
        Part of the names of parameters whose errors are to shrink, rather than predictions'.
    seed : int
        Of everything random.
    progress : bool or callable, optional
        Whether to show a bar; or who is told the share done, and how things stand.

    Raises
    ------
    DataError
        On limits that nothing can be told within, or recordings that fit neither rig nor model.
    ModelError
        On models that no plan can be made with, or a goal that names no parameter.
    """
    recorded = listed(recordings)
    if (muscle is not None and recorded) or not (recorded or rig is not None or muscle is not None):
        raise DataError(
            "a plan is from recordings, or from a rig, a muscle or both",
            remedy="give files, --rig or --muscle, but no --muscle with files, which tell of theirs",
        )
    if muscle is not None and model is not None:
        raise DataError(
            "a muscle of the library or a data sheet is a model itself", remedy="leave --model out"
        )
    if not 0 < minutes <= MOST_MINUTES:
        raise DataError(
            f"{minutes:g} minutes are impossible", remedy="give --minutes 3, or up to 60"
        )
    generator(seed)  # refuses what is no seed
    asked = limits or {}
    plant = rig if isinstance(rig, Rig) or rig is None else load_rig(rig)
    if muscle is not None:
        belief = from_muscle(muscle, plant)
        within = narrowed(belief.limits, asked)
    elif recorded:
        belief = from_recordings(recorded, model, plant, seed)
        within = narrowed(belief.limits, asked)
        if plant is None:
            notes = (*belief.notes, *beyond(within, belief.limits))
            belief = replace(belief, notes=notes)
    else:
        assert plant is not None
        within = narrowed(limits_of_rig(plant), asked)
        within_hardware(within, plant)
        possible(within, 60 * minutes)
        belief = from_rig(plant, model, within, seed)
    if plant is not None:
        within_hardware({name: within[name] for name in plant.inputs if name in within}, plant)
    possible(within, 60 * minutes)
    try:
        with one_blas_thread(), telling(progress, "planning") as tell:
            prospect = prospect_of(belief, within, 60 * minutes, goal, seed)
            return Search(prospect, seed, tell).found(belief, goal)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise ModelError(
            f"{belief.block.kind!r} does not run free within these limits ({error}). "
            "Remedy: identify it again, or plan with another --model."
        ) from None


def possible(limits: Limits, seconds: float) -> None:
    """Refuse limits within which nothing can be told in the time.

    Raises
    ------
    DataError
        Naming the channel and the remedy.
    """
    if not any(limit.span > 0 for limit in limits.values()):
        raise DataError(
            f"none of {', '.join(limits)} may move", remedy="give wider limits with --limits"
        )
    for name, limit in limits.items():
        way, unit = limit.span / limit.rate, standard_unit(name) or ""
        if way > SHARE_OF_WAYS * seconds:
            raise DataError(
                f"at {limit.rate:.3g} {unit}/s, {name} takes {way:.3g} s from end to end, which is too "
                f"much of {seconds:g} s",
                remedy=f"give --minutes {_up(way / SHARE_OF_WAYS / 60)} or more, a higher rate, or "
                "limits closer together",
            )


def _up(minutes: float) -> str:
    """Return minutes rounded up to two digits.

    >>> _up(0.7533), _up(12.01)
    ('0.76', '13')
    """
    grain = 10.0 ** (math.floor(math.log10(minutes)) - 1)
    return f"{math.ceil(minutes / grain - 1e-9) * grain:.2g}"
