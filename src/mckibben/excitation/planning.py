"""What to record next: the motion that leaves the least expected error of a model.

Stretches of motion are chosen one after another, each the best of many given what recordings and the
stretches before it tell, then exchanged one by one. The criterion is the variance of free-running
predictions of random motion (or of chosen parameters), averaged over a few likely sets of parameters.
Random motion itself is among what is chosen from, in whole and in parts, so that by its own measure a
plan is never worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.errors import DataError
from mckibben.excitation.believed import Belief, from_muscle, from_recordings, from_rig
from mckibben.excitation.candidates import Stretch, random_plan, stretches
from mckibben.excitation.information import Known, Place, standard_errors
from mckibben.excitation.limits import (
    Limits,
    at_rates,
    followed,
    limits_of_rig,
    narrowed,
    slower,
    within_hardware,
)
from mckibben.excitation.prospect import Prospect, prospect_of
from mckibben.recording import Recording
from mckibben.rigs import Rig, load_rig
from mckibben.system.threads import one_blas_thread

CANDIDATES = 32
"""Stretches tried at every step."""

BASELINES = 3
"""Plans of random motion that are tried whole."""

EXCHANGES = 1.5
"""Stretches tried again in the end, over how many there are."""

CALM = 1.0
"""Time at rest before motion begins [s]."""

SHARE_OF_WAYS = 0.25
"""Most of the time that crossing the range once may take."""

LEARNED = 1.05
"""Factor by which a standard error has to fall for a stretch to be for it."""

MOST_MINUTES = 60.0
"""Longest plan: longer ones are better made after the first has been recorded."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Parameter:
    """A parameter, and its expected standard errors relative to its value, now and after."""

    name: str
    value: float
    now: float
    after: float


@dataclass(frozen=True)
class Step:
    """A stretch of a plan: from and to when [s], what is done, and what for."""

    start: float
    stop: float
    what: str
    why: str


@dataclass(frozen=True)
class Plan:
    """What to record next.

    Parameters
    ----------
    recording : Recording
        The commands, with time.
    parameters : tuple of Parameter
        With their expected errors.
    errors : dict
        By output, expected errors of free-running predictions now and after, in its unit.
    random : dict
        The same after as much random motion.
    steps : tuple of Step
        Which part is for what.
    notes : tuple of str
        What the user should know.
    interrupted : bool
        Whether the search was stopped; the plan is then the best until there.
    goal : str or None
        Parts of the names of parameters that it is for, rather than predictions.
    """

    recording: Recording
    parameters: tuple[Parameter, ...]
    errors: dict[str, tuple[float, float]]
    random: dict[str, float]
    steps: tuple[Step, ...]
    notes: tuple[str, ...]
    interrupted: bool
    goal: str | None

    @property
    def sentence(self) -> str:
        """What it is good for, in words."""
        found = []
        for name, (now, after) in self.errors.items():
            unit = "N" if name.startswith("force") else "mm"
            found.append(f"{name} {after:.3g} {unit} instead of {now:.3g}")
        said = (
            f"After these {self.recording.duration:.0f} s, predictions of random motion should be off "
            f"by: {', '.join(found)}"
        )
        told = [
            f"{one.name} (standard error from {_share(one.now)} to {_share(one.after)})"
            for one in self.learned[:3]
        ]
        return f"{said}. {'Most is' if self.goal is None else 'It is'} learned of {'; '.join(told)}."

    @property
    def learned(self) -> list[Parameter]:
        """The parameters that it is for, or all, those first of which most is learned."""
        parts = [part.strip() for part in (self.goal or "").split(",")]
        named = [one for one in self.parameters if any(part in one.name for part in parts)]
        return sorted(named, key=lambda one: one.after / one.now)

    def to_dict(self) -> dict[str, Any]:
        """Return all but the samples, as JSON holds it."""
        return {
            "seconds": self.recording.duration,
            "sentence": self.sentence,
            "errors": {
                name: {"now": now, "after": after, "after_random_motion": self.random[name]}
                for name, (now, after) in self.errors.items()
            },
            "parameters": [vars(one) for one in self.parameters],
            "steps": [vars(one) for one in self.steps],
            "start": {name: float(v[0]) for name, v in self.recording.channels.items()},
            "interrupted": self.interrupted,
            "notes": list(self.notes),
        }


def _share(value: float) -> str:
    return f"{100 * value:.2g} %" if value < 1 else f"{100 * value:.0f} %"


def plan(
    recordings: Recording | Sequence[Recording] = (),
    *,
    rig: str | Path | Rig | None = None,
    muscle: str | Path | None = None,
    model: str | Block | None = None,
    minutes: float = 3.0,
    limits: dict[str, Sequence[float | None]] | None = None,
    goal: str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Plan:
    """Return what to record next.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What there is, to which a model is fitted and from which it is known what they tell.
    rig : str, path or Rig, optional
        That is to be driven: its channels and limits. Without recordings, what it says of itself is
        taken for likely.
    muscle : str or path, optional
        A muscle of the library, or a data sheet (.toml), in place of recordings.
    model : str or Block, optional
        What is fitted, or has been; default ``balance``, or ``multistate`` where force is measured.
    minutes : float
        How long to record.
    limits : dict of str to sequence of float, optional
        By channel its lowest and highest command and, in its unit a second, its rate; None for what
        stays as it is. Default those of the rig, or those of the recordings.
    goal : str, optional
        Part of the names of parameters whose errors are to shrink, rather than predictions'.
    seed : int
        Of everything random.
    progress : callable, optional
        Told the share done, and how things stand.

    Raises
    ------
    DataError
        On limits that nothing can be told within, or recordings that fit neither rig nor model.
    ModelError
        On models that no plan can be made with, or a goal that names no parameter.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if sum((bool(listed or rig is not None), muscle is not None)) != 1:
        raise DataError(
            "a plan is for recordings, for a rig, or for a muscle",
            remedy="give files, --rig or --muscle (and a muscle without the others)",
        )
    if muscle is not None and model is not None:
        raise DataError(
            "a muscle of the library or a data sheet is a model itself", remedy="leave --model out"
        )
    if not 0 < minutes <= MOST_MINUTES:
        raise DataError(f"{minutes:g} minutes are impossible", remedy="give --minutes 3, or up to 60")
    asked = limits or {}
    plant = rig if isinstance(rig, Rig) or rig is None else load_rig(rig)
    if muscle is not None:
        belief = from_muscle(muscle)
        within = narrowed(belief.limits, asked)
    elif listed:
        belief = from_recordings(listed, model, plant, seed)
        within = narrowed(belief.limits, asked)
    else:
        assert plant is not None
        within = narrowed(limits_of_rig(plant), asked)
        within_hardware(within, plant)
        possible(within, 60 * minutes)
        belief = from_rig(plant, model, within, seed)
    if plant is not None:
        within_hardware(within, plant)
    possible(within, 60 * minutes)
    with one_blas_thread():
        prospect = prospect_of(belief, within, 60 * minutes, goal, seed)
        return _Search(prospect, seed, progress).found(belief, goal)


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
        way = limit.span / limit.rate
        if way > SHARE_OF_WAYS * seconds:
            raise DataError(
                f"at {limit.rate:.3g} a second, {name} takes {way:.3g} s from end to end, which "
                f"is too much of {seconds:g} s",
                remedy=f"give --minutes {way / SHARE_OF_WAYS / 60:.2g} or more, a higher rate, or "
                "limits closer together",
            )


class _Search:
    """The search for a plan."""

    def __init__(self, prospect: Prospect, seed: int, progress: Progress | None) -> None:
        self.prospect, self.progress = prospect, progress
        self.rng = np.random.default_rng(seed)
        self.rest = at_rates(prospect.limits)[3]

    def path(self, stretch: Stretch, start: Array, *, first: bool) -> Array:
        """Return the commands of a stretch, from where the last one ended."""
        targets = stretch.targets
        if first:
            targets = targets.copy()
            targets[: round(CALM / self.prospect.step)] = self.rest
        own = slower(self.prospect.limits, stretch.speed)
        return followed(targets, start, own, self.prospect.step)

    def run(
        self, design: Sequence[Stretch], known: Known, place: Place, first: int = 0
    ) -> list[tuple[Array, Known, Place]]:
        """Return commands, what is known and the place after every stretch from one on."""
        found = []
        for number, stretch in enumerate(design[first:], start=first):
            commands = self.path(stretch, place.command, first=number == 0)
            told, place = self.prospect.criterion.over(commands, place)
            known = known.and_also(told)
            found.append((commands, known, place))
        return found

    def tell(self, share: float, score: float) -> None:
        if self.progress is not None:
            error = 100 * float(np.sqrt(score))
            self.progress(share, f"{100 * share:.0f} %, expected error {error:.3g} % of range")

    def found(self, belief: Belief, goal: str | None) -> Plan:
        """Return the best plan."""
        prospect, score = self.prospect, self.prospect.criterion
        before, origin = prospect.known, score.start(self.rest)
        n, n_last = prospect.n_stretches, prospect.n_last
        home = [Stretch("back to rest", np.tile(self.rest, (prospect.length, 1)))] * n_last
        plans = [
            random_plan(prospect.limits, n - n_last, prospect.length, prospect.step, self.rng) + home
            for _ in range(BASELINES)
        ]
        design, run, interrupted = plans[0], self.run(plans[0], before, origin), False
        random_known = run[-1][1]
        done: list[Stretch] = []
        try:
            for other in plans[1:]:
                design, run = self.better(design, run, other, self.run(other, before, origin))
            random_known = run[-1][1]
            known, place = before, origin
            for number in range(n - n_last):
                tried = stretches(
                    place.command, prospect.limits, prospect.length, prospect.step, CANDIDATES, self.rng
                )
                tried += [other[number] for other in plans]
                best, least = tried[0], np.inf
                for stretch in tried:
                    commands = self.path(stretch, place.command, first=number == 0)
                    told, after = score.over(commands, place)
                    value = score(known.and_also(told))
                    if value < least:
                        best, least, then = stretch, value, (known.and_also(told), after)
                done.append(best)
                known, place = then
                self.tell(0.75 * (number + 1) / n, least)
            chosen = done + home
            design, run = self.better(design, run, chosen, self.run(chosen, before, origin))
            tries = round(EXCHANGES * (n - n_last))
            for number in range(tries):
                design, run = self.exchanged(design, run, before, origin)
                self.tell(0.75 + 0.25 * (number + 1) / tries, score(run[-1][1]))
        except KeyboardInterrupt:
            interrupted = True
            half = [*done, *plans[0][len(done) :]]
            design, run = self.better(design, run, half, self.run(half, before, origin))
        return self.told(belief, design, run, random_known, goal, interrupted=interrupted)

    def better(self, design: Any, run: Any, other: Any, other_run: Any) -> tuple[Any, Any]:
        """Return the better of two plans."""
        score = self.prospect.criterion
        return (other, other_run) if score(other_run[-1][1]) < score(run[-1][1]) else (design, run)

    def exchanged(
        self, design: list[Stretch], run: Any, before: Known, origin: Place
    ) -> tuple[list[Stretch], Any]:
        """Return the plan with another stretch somewhere, if it is better."""
        prospect = self.prospect
        place = int(self.rng.integers(prospect.n_stretches - prospect.n_last))
        _, known, start = run[place - 1] if place else (None, before, origin)
        (stretch,) = stretches(
            start.command, prospect.limits, prospect.length, prospect.step, 1, self.rng
        )
        other = [*design[:place], stretch, *design[place + 1 :]]
        return self.better(design, run, other, [*run[:place], *self.run(other, known, start, place)])

    def told(
        self,
        belief: Belief,
        design: Sequence[Stretch],
        run: Sequence[tuple[Array, Known, Place]],
        random_known: Known,
        goal: str | None,
        *,
        interrupted: bool,
    ) -> Plan:
        """Return the plan in words and numbers."""
        prospect = self.prospect
        names, values = prospect.names, prospect.values
        past = [standard_errors(prospect.known.members[0])]
        past += [standard_errors(known.members[0]) for _, known, _ in run]
        parameters = tuple(
            Parameter(name, float(value), float(now), float(after))
            for name, value, now, after in zip(names, values, past[0], past[-1], strict=True)
        )
        steps = []
        seconds = prospect.length * prospect.step
        for number, stretch in enumerate(design):
            gain = past[number] / past[number + 1]
            order = [place for place in np.argsort(-gain).tolist() if gain[place] > LEARNED][:2]
            why = ", ".join(names[place] for place in order) or "motion where little has been"
            if stretch.what == "back to rest":
                why = "to end at rest"
            steps.append(Step(number * seconds, (number + 1) * seconds, stretch.what, why))
        commands = np.vstack([self.rest, *(commands for commands, _, _ in run)])
        coarse = prospect.step * np.arange(len(commands))
        fine = belief.step * np.arange(int(coarse[-1] / belief.step + 1e-9) + 1)
        channels = {
            name: np.interp(fine, coarse, column)
            for name, column in zip(prospect.limits, commands.T, strict=True)
        }
        before, after, random = (
            prospect.by_motion(known) for known in (prospect.known, run[-1][1], random_known)
        )
        spans = dict(zip(prospect.outputs, prospect.criterion.spans.tolist(), strict=True))
        return Plan(
            Recording(channels, belief.step, meta={"name": "next", "planned": True}),
            parameters,
            {name: (before * span, after * span) for name, span in spans.items()},
            {name: random * span for name, span in spans.items()},
            tuple(steps),
            belief.notes,
            interrupted,
            goal,
        )
