"""The search for a plan: stretches chosen one after another, then exchanged one by one.

Each is the best of many given what recordings and the stretches before it tell, and what random motion
would after it. That is among what is chosen from, too, so that by its own measure a plan is never worse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.excitation.believed import Belief
from mckibben.excitation.candidates import Stretch, random_plan, stretches
from mckibben.excitation.information import Criterion, Known, Place, standard_errors
from mckibben.excitation.limits import at_rates, followed, slower
from mckibben.excitation.plans import Parameter, Plan, Step
from mckibben.excitation.prospect import Prospect
from mckibben.recording import Recording

WORK = 1.2e8
"""Samples times states of free runs that a search may take: about a quarter of a minute of one core, and
the same plan on any."""

CANDIDATES, FEWEST = 32, 12
"""Stretches tried at every step: most, and least where the work is not enough for more."""

KEPT = 3
"""How many of them, the best for the likeliest parameters, are tried with all that are likely."""

BASELINES = 2
"""Plans of random motion that are tried whole."""

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
        self.criterion, self.likeliest = prospect.criterion, prospect.criterion.of_first()
        self.spent = 0

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
            known, place = self.after(self.criterion, commands, known, place)
            found.append((commands, known, place))
        return found

    def after(
        self, criterion: Criterion, commands: Array, known: Known, place: Place
    ) -> tuple[Known, Place]:
        """Return what is known and the place after commands, and count the work."""
        told, place = criterion.over(commands, place)
        self.spent += len(commands) * sum(states.size for states in place.states)
        return known.and_also(told), place

    def best(self, tried: Sequence[Stretch], known: Known, place: Place, *, first: bool) -> Stretch:
        """Return the stretch that leaves least, of those that do so for the likeliest parameters."""
        paths = [self.path(stretch, place.command, first=first) for stretch in tried]

        def left(criterion: Criterion, number: int, known: Known) -> float:
            return criterion(self.after(criterion, paths[number], known, place)[0])

        likely = known.of_first()
        values = [left(self.likeliest, number, likely) for number in range(len(tried))]
        kept = np.argsort(values, kind="stable")[:KEPT].tolist()
        return tried[min(kept, key=lambda number: left(self.criterion, number, known))]

    def tell(self, share: float, score: float) -> None:
        """Tell of progress."""
        if self.progress is not None:
            error = 100 * float(np.sqrt(score))
            self.progress(share, f"{100 * share:.0f} %, expected error {error:.3g} % of range")

    def found(self, belief: Belief, goal: str | None) -> Plan:
        """Return the best plan."""
        prospect, score = self.prospect, self.criterion
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
        try:
            for other in plans[1:]:
                design, run = self.better(design, run, other, self.run(other, before, origin))
            random_known = run[-1][1]
            count = self.affordable(n)
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
                then = run[-1][1].without(run[number][1])
                done.append(self.best(tried, known.and_also(then), place, first=number == 0))
                ((_, known, place),) = self.run(done, known, place, number)
                self.tell(0.75 * (number + 1) / n, score(known.and_also(then)))
            chosen = done + home
            design, run = self.better(design, run, chosen, self.run(chosen, before, origin))
            for number in range(n - n_last):
                if self.spent > WORK:
                    break
                design, run = self.exchanged(design, run, before, origin)
                self.tell(0.75 + 0.25 * (number + 1) / (n - n_last), score(run[-1][1]))
        except KeyboardInterrupt:
            interrupted = True
            half = [*done, *plans[0][len(done) :]]
            design, run = self.better(design, run, half, self.run(half, before, origin))
        return self.told(belief, design, run, random_known, goal, interrupted=interrupted)

    def affordable(self, n: int) -> int:
        """Return how many stretches may be tried at each of n steps, after the plans of random motion.

        As much work again is left for exchanges.
        """
        members = len(self.criterion.members)
        one = self.spent / (BASELINES * n * members)
        count = int(0.5 * (WORK - self.spent) / (n * one)) - (KEPT + 1) * members - BASELINES
        return min(max(count, FEWEST), CANDIDATES)

    def better(self, design: Any, run: Any, other: Any, other_run: Any) -> tuple[Any, Any]:
        """Return the better of two plans."""
        score = self.criterion
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
            why = ", ".join(names[place] for place in order) or "motion like what is predicted"
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
            {channel.name: channel.unit for channel in belief.block.outputs},
            tuple(steps),
            belief.notes,
            interrupted,
            goal,
        )
