"""Controllers in closed loops on plants that know no model.

    python benchmarks/loops.py [PLANT ...]     writes docs/measured/loops.md

Every controller of this package runs on the plants of tests/plants, which are textbook physics, with
noise in what is measured. Models are fitted to each plant's training runs; the motion to follow is what
the plant does, without noise, in a test run of another seed. Takes about half an hour.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant

from mckibben import Block, Recording, invert, study
from mckibben.arrays import Array
from mckibben.control import Tracked, control_law, learn, track, tune_pid
from mckibben.control.controller import preview_time, samples_ahead
from mckibben.control.twin import Ends, Twin
from mckibben.control.uncompensated import Rule
from mckibben.errors import MckibbenError
from mckibben.numerals import numeral
from mckibben.recording import COMMAND
from mckibben.studying.inverting import static_map

PAGE_FILE = Path(__file__).parent.parent / "docs" / "measured" / "loops.md"

REPETITIONS = 8
"""Of iterative learning."""

SECONDS = 20.0
"""Length of the motion, so that a plant can be answered from its beginning at every step."""

APPROACH = 5.0
"""Time to get to the first sample of the motion [s]."""

STATIC = "static map"

TITLES = {
    STATIC: "static map",
    "pid": "PID",
    "feedforward": "compensator",
    "feedforward-pid": "+ PID",
    "observer": "+ observer",
    "predictive": "+ MPC",
    "learned": "+ ILC",
}


class Answering:
    """A plant that is run in a loop: at every step it answers all commands since its beginning."""

    def __init__(self, plant: Plant) -> None:
        self.name = plant.name
        self.inputs, self.outputs = plant.bench.pressures, plant.bench.outputs
        self._plant, self._commands = plant, np.empty((0, len(self.inputs)))

    def limits(self, name: str) -> Ends:
        """Return the range of the commands."""
        return Ends(0.0, self._plant.bench.high)

    def changed(self, settings: Mapping[str, Any]) -> Answering:
        """Return another one; its sample time is the bench's."""
        return Answering(self._plant)

    def reset(self, seed: int = 0) -> Array:
        """Vent it, and return what is measured."""
        self._commands = np.zeros((1, len(self.inputs)))
        return self._answer()

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for a sample time, and return what is measured then."""
        assert isinstance(action, Mapping)
        row = [[action[name] for name in self.inputs]]
        self._commands = np.vstack([self._commands[:-1], row, row])
        return self._answer()

    def _answer(self) -> Array:
        bench = self._plant.bench
        loads = np.full((len(self._commands), len(bench.loads)), bench.load)
        answered: Array = self._plant.respond(bench.allowed(self._commands), loads)[-1]
        return np.atleast_1d(answered)


@dataclass(frozen=True)
class Result:
    """A controller on a plant: its error, effort and time a step, or why there is none.

    In per cent of the motion's range, in bar/s or V/s, and in microseconds of Python.
    """

    law: str
    error: float = np.nan
    effort: float = np.nan
    step_time: float = np.nan
    reason: str = ""


def motion(name: str, plant: Plant) -> Recording:
    """Return what a plant does without noise in the first test run of another seed, with its load."""
    bench = plant.bench
    run = next(iter(PLANTS[name](1).test.values()))[0]
    pressures = run.matrix(bench.pressures)[: round(SECONDS / bench.sample_time)]
    loads = np.full((len(pressures), len(bench.loads)), bench.load)
    outputs = plant.respond(bench.allowed(pressures), loads).reshape(len(pressures), -1)
    names = bench.outputs + bench.loads
    columns = dict(zip(names, np.column_stack([outputs, loads]).T, strict=True))
    return Recording(columns, bench.sample_time, {name: run.units[name] for name in names})


def static_law(plant: Plant) -> Rule:
    """Return pressures as a polynomial of the outputs, fitted to the training runs."""
    bench = plant.bench
    wanted = [run.matrix(bench.pressures) for run in plant.train]
    found = static_map([run.matrix(bench.outputs) for run in plant.train], wanted)
    return Rule(lambda y: np.clip(found(y[np.newaxis])[0], 0.0, bench.high))


def fitted(plant: Plant) -> Block:
    """Return the compensator that `study` hands over."""
    bench, load = plant.bench, plant.bench.loads
    found = study(
        list(plant.train),
        [run for runs in plant.test.values() for run in runs],
        input=bench.pressures,
        output=bench.outputs,
        load=load[0] if len(load) == 1 else None,
        models="quick",
    ).inverse
    if found is None:
        raise MckibbenError("no compensator is recommended", remedy="record more")
    return found.inverse


def results(name: str, seed: int) -> Iterator[Result]:
    """Yield what every controller does on a plant."""
    plant = PLANTS[name](0)
    asked, noise = motion(name, plant), plant.bench.noise[1]
    loop: dict[str, Any] = {"approach": APPROACH, "noise": noise, "pressure_loop": False}
    seeds = count(seed)

    def closed(controller: Any) -> Tracked:
        return track(controller, Answering(plant), asked, seed=next(seeds), **loop)

    def tried(law: str, make: Callable[[], Any]) -> Result:
        try:
            return scored(law, closed(make()), plant)
        except MckibbenError as error:
            return Result(law, reason=str(error))

    yield tried(STATIC, lambda: static_law(plant))
    inverse = fitted(plant)
    model = inverse.forward_model
    assert model is not None
    held = dict.fromkeys(plant.bench.loads, plant.bench.load)
    limits = dict.fromkeys(plant.bench.pressures, (0.0, plant.bench.high))
    twin = Twin(model, limits=limits, held=held)
    step = plant.bench.sample_time
    tuned = lambda: tune_pid(twin, sample_time=step, references=inverse.inputs)  # noqa: E731
    for law in ("pid", "feedforward", "feedforward-pid", "observer"):
        yield tried(law, partial(control_law, law, inverse, tuned))
    yield tried("predictive", lambda: invert(model, predictive=True).model)

    def taught() -> Block:
        ahead = max(samples_ahead(preview_time(inverse), step), 1) + inverse.samples_ahead
        repeat = lambda corrected: closed(corrected).recording  # noqa: E731
        return learn(inverse, repeat, REPETITIONS, ahead=ahead, settle=round(APPROACH / step)).best

    yield tried("learned", taught)


def scored(law: str, found: Tracked, plant: Plant) -> Result:
    """Return the error and the effort of a loop."""
    bench, one = plant.bench, found.recording
    rows = slice(round(APPROACH / bench.sample_time), None)
    spans = [np.ptp(one[f"reference_{name}"][rows]) for name in bench.outputs]
    errors = [found.rmse[name] for name in bench.outputs]
    moved = np.diff(one.matrix([COMMAND + name for name in bench.pressures])[rows], axis=0)
    effort = float(np.sqrt((moved**2).mean()) / bench.sample_time)
    error = 100 * float(np.mean(np.divide(errors, spans)))
    return Result(law, error, effort, 1e6 * found.step_time[0])


PAGE = """# Controllers in closed loops

```{{index}} closed loop, PID, MPC, ILC, disturbance observer, predictive, feedback
```

Free motions followed on {count} plants of textbook physics (`tests/plants`), none of which is a model of
this package. The compensator is the one that `mckibben study` hands over for the plant's training
recordings; + is what is added to it: PID, a disturbance observer, preview of the motion (MPC), or
{repetitions} repetitions of it (ILC). PID is tuned on the fitted model; sensors have the plant's noise.
*Error* is the RMSE in per cent of the range of the motion, *effort* the RMS rate of the commands
[bar/s or V/s], *step* the median time of a step in Python. For C on a microcontroller see
[its page](../deploy/microcontroller.md).

Written by `python benchmarks/loops.py`.

## Error [% of range]

| plant | {laws} |
|---|{dashes}
{errors}
| median | {medians} |

## Effort and time

| controller | effort, median over plants | step [µs], median |
|---|---:|---:|
{efforts}
{reasons}"""


def page(found: Mapping[str, list[Result]]) -> str:
    """Return the page of all results."""
    laws = [*TITLES]
    table = {plant: {one.law: one for one in rows} for plant, rows in found.items()}

    def column(law: str, key: str) -> float:
        values = [getattr(rows[law], key) for rows in table.values() if law in rows]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan

    def cells(values: list[float]) -> str:
        return " | ".join(numeral(value, 2) for value in values)

    each = [
        f"| {plant} | {cells([rows[law].error if law in rows else np.nan for law in laws])} |"
        for plant, rows in table.items()
    ]
    efforts = [
        f"| {TITLES[law]} | {cells([column(law, 'effort'), column(law, 'step_time')])} |"
        for law in laws
    ]
    reasons = [
        f"- {plant}, {TITLES[one.law]}: {one.reason}"
        for plant, rows in found.items()
        for one in rows
        if one.reason
    ]
    return PAGE.format(
        count=len(found),
        repetitions=REPETITIONS,
        laws=" | ".join(TITLES[law] for law in laws),
        dashes="---:|" * len(laws),
        errors="\n".join(each),
        medians=cells([column(law, "error") for law in laws]),
        efforts="\n".join(efforts),
        reasons="\n".join(["", "## Without a result", "", *reasons, ""] if reasons else [""]),
    )


def main() -> None:
    """Run every controller on every plant, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    found: dict[str, list[Result]] = {}
    for name in given.plants:
        found[name] = []
        try:
            for one in results(name, given.seed):
                found[name].append(one)
                print(name, one, flush=True)
        except MckibbenError as error:
            found[name].append(Result("feedforward", reason=str(error)))
            print(name, error, flush=True)
    PAGE_FILE.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
