"""The search for a plan: stretches chosen one after another, then exchanged one by one.

Each is the best of many given what recordings and the stretches before it tell. Random motion is among
what is chosen from, in whole and in parts, so that by its own measure a plan is never worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.excitation.believed import Belief
from mckibben.excitation.candidates import Stretch, random_plan, stretches
from mckibben.excitation.information import Known, Place, standard_errors
from mckibben.excitation.limits import at_rates, followed, slower
from mckibben.excitation.plans import Parameter, Plan, Step
from mckibben.excitation.prospect import Prospect
from mckibben.recording import Recording

CANDIDATES, FEWER, QUICK = 32, 16, 50
"""Stretches tried at every step: most, least, and up to how many parameters the most are tried."""

BASELINES = 3
"""Plans of random motion that are tried whole."""

EXCHANGES = 1.0
"""Stretches tried again in the end, over how many there are."""

CALM = 1.0
"""Time at rest before motion begins [s]."""

LEARNED = 1.05
"""Factor by which a standard error has to fall for a stretch to be for it."""

Progress = Callable[[float, str], None]
"""Told the share of the work done, and how things stand."""


class Search:
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
        """Tell of progress."""
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
            random_plan(prospect.limits, n - n_last, prospect.length, prospect.step, self.rng)
            + home
            for _ in range(BASELINES)
        ]
        design, run, interrupted = plans[0], self.run(plans[0], before, origin), False
        random_known = run[-1][1]
        done: list[Stretch] = []
        count = max(min(CANDIDATES, CANDIDATES * QUICK // len(prospect.names)), FEWER)
        try:
            for other in plans[1:]:
                design, run = self.better(design, run, other, self.run(other, before, origin))
            random_known = run[-1][1]
            known, place = before, origin
            for number in range(n - n_last):
                tried = stretches(
                    place.command,
                    prospect.limits,
                    prospect.length,
                    prospect.step,
                    count,
                    self.rng,
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
        return self.better(
            design, run, other, [*run[:place], *self.run(other, known, start, place)]
        )

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
            if belief.driven is None or name in belief.driven
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
