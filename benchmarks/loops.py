"""Controllers in closed loops on plants that know no model.

Their environment: python3 -m venv peers-env && peers-env/bin/pip install . -r benchmarks/peers.txt
Run: peers-env/bin/python benchmarks/loops.py [PLANT ...] [--only LAW] [--seed N] [--page]

Every controller of this package runs on the plants of tests/plants, which are textbook physics, with
noise in what is measured, and a policy learned by reinforcement beside them. Models are fitted to each
plant's training runs; the motion to follow is what the plant does, without noise, in a test run of
another seed. Results replace those of docs/measured/loops.csv, from which docs/measured/loops.md is
written. Steps are counted as by benchmarks/microcontroller.py, whose programs it wants. Takes half an
hour, nearly all of it for the policies and the fits.
"""

from __future__ import annotations

import argparse
import csv
import sys
import warnings
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant

from loops_policy import AHEAD, LAG, trained
from loops_policy import Learned as Policy
from mckibben import Block, Recording, invert, study
from mckibben.arrays import Array
from mckibben.blocks.feedback import PIDFeedback
from mckibben.control import Tracked, control_law, learn, track, tune_pid
from mckibben.control.controller import (
    DisturbanceObserver,
    preview_time,
    samples_ahead,
)
from mckibben.control.twin import Ends, Twin
from mckibben.control.uncompensated import Rule
from mckibben.errors import MckibbenError
from mckibben.exporting.c.emulation import emulate, missing_tools
from mckibben.numerals import numeral
from mckibben.recording import COMMAND
from mckibben.studying.inverting import static_map

FOLDER = Path(__file__).parent.parent / "docs" / "measured"
PAGE_FILE, TABLE_FILE = FOLDER / "loops.md", FOLDER / "loops.csv"

REPETITIONS = 8
"""Of iterative learning."""

SECONDS, APPROACH = 20.0, 5.0
"""Length of the motion, and time to get to its first sample [s]."""

LONGEST = SECONDS + APPROACH + 5.0
"""A loop is shorter [s]."""

SEEDS, TRAINING = 2, 20.0
"""Policies for each plant, of which the median counts, and processor time to train each [s]."""

STATIC, POLICY = "static map", "policy"

TITLES = {
    STATIC: "static map",
    "pid": "PID",
    "feedforward": "compensator",
    "feedforward-pid": "+ PID",
    "observer": "+ observer",
    "predictive": "+ MPC",
    "learned": "+ ILC",
    POLICY: "policy",
}


class Answering:
    """A plant in a loop, in which a command is reached at the next sample.

    It begins as its recordings do: filled to the first command, or vented.
    """

    def __init__(self, plant: Plant) -> None:
        self.name = plant.name
        self.inputs, self.outputs = plant.bench.pressures, plant.bench.outputs
        self._plant = plant

    def limits(self, name: str) -> Ends:
        """Return the range of the commands."""
        return Ends(0.0, self._plant.bench.high)

    def changed(self, settings: Mapping[str, Any]) -> Answering:
        """Return another one; its sample time is the bench's."""
        return Answering(self._plant)

    def reset(self, seed: int = 0) -> Array:
        """Vent it, and return what is measured."""
        self._begin(np.zeros(len(self.inputs)))
        return self._answer()

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Reach commands, and return what is measured then."""
        assert isinstance(action, Mapping)
        row = np.array([action[name] for name in self.inputs])
        if self._samples == 1:
            self._begin(row)
            self._answer()
        self._motion.commands[self._samples] = row
        return self._answer()

    def _begin(self, row: Array) -> None:
        bench = self._plant.bench
        n = round(LONGEST / bench.sample_time)
        loads = np.full((n, len(bench.loads)), bench.load)
        self._motion, self._samples = self._plant.move(np.tile(row, (n, 1)), loads), 0

    def _answer(self) -> Array:
        self._samples += 1
        return np.atleast_1d(np.asarray(next(self._motion.outputs), dtype=np.float64))


@dataclass(frozen=True)
class Result:
    """A controller on a plant: its error, its effort and the instructions of a step, or why not.

    In per cent of the motion's range, in bar/s or V/s, and the median and the most of a Cortex-M4F.
    """

    plant: str
    law: str
    error: float = np.nan
    effort: float = np.nan
    instructions: float = np.nan
    most: float = np.nan
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


def results(name: str, seed: int, laws: Container[str]) -> Iterator[Result]:
    """Yield what every controller does on a plant."""
    plant = PLANTS[name](0)
    asked, noise = motion(name, plant), plant.bench.noise[1]
    step = plant.bench.sample_time

    def closed(controller: Any, seed: int = seed) -> Tracked:
        loop: dict[str, Any] = {"approach": APPROACH, "noise": noise, "pressure_loop": False}
        return track(controller, Answering(plant), asked, seed=seed, **loop)

    def tried(law: str, make: Callable[[], Any]) -> Result:
        try:
            controller = make()
            found = scored(law, closed(controller), plant)
        except MckibbenError as error:
            return Result(name, law, reason=str(error))
        try:
            median, most = counted(controller, step)
        except MckibbenError as error:
            return replace(found, reason=f"not exported: {error}")
        return replace(found, instructions=median, most=most)

    if STATIC in laws:
        yield tried(STATIC, lambda: static_law(plant))
    inverse = fitted(plant)
    model = inverse.forward_model
    assert model is not None
    held = dict.fromkeys(plant.bench.loads, plant.bench.load)
    limits = dict.fromkeys(plant.bench.pressures, (0.0, plant.bench.high))
    twin = Twin(model, limits=limits, held=held)
    references = inverse.inputs[: inverse.n_driven]

    def tuned() -> PIDFeedback:
        return tune_pid(twin, sample_time=step, scheduled=held, references=references)

    def taught() -> Block:
        ahead = max(samples_ahead(preview_time(inverse), step), 1) + inverse.samples_ahead
        seeds = count(seed + 1)

        def repeat(corrected: Block) -> Recording:
            """Return what sensors see of a repetition."""
            one, rng = closed(corrected, next(seeds)).recording, np.random.default_rng(next(seeds))
            seen = {
                output: one[output] + noise * rng.standard_normal(len(one))
                for output in plant.bench.outputs
            }
            return one.with_channels(**seen)

        return learn(inverse, repeat, REPETITIONS, ahead=ahead, settle=round(APPROACH / step)).best

    makers: dict[str, Callable[[], Any]] = {
        law: partial(control_law, law, inverse, tuned)
        for law in ("pid", "feedforward", "feedforward-pid", "observer")
    }
    makers["predictive"] = lambda: invert(model, predictive=True).model
    makers["learned"] = taught
    for law, make in makers.items():
        if law in laws:
            yield tried(law, make)
    if POLICY in laws:
        learned = [
            scored(
                POLICY, closed(Policy(*trained(model, plant.bench, k, TRAINING)), seed + k), plant
            )
            for k in range(SEEDS)
        ]
        for one in learned:
            print("    of", one, flush=True)
        error, effort = np.median([(one.error, one.effort) for one in learned], axis=0)
        yield Result(name, POLICY, float(error), float(effort))


def scored(law: str, found: Tracked, plant: Plant) -> Result:
    """Return the error and the effort of a loop."""
    bench, one = plant.bench, found.recording
    rows = slice(round(APPROACH / bench.sample_time), None)
    spans = [np.ptp(one[f"reference_{name}"][rows]) for name in bench.outputs]
    errors = [found.rmse[name] for name in bench.outputs]
    moved = np.diff(one.matrix([COMMAND + name for name in bench.pressures])[rows], axis=0)
    effort = float(np.sqrt((moved**2).mean()) / bench.sample_time)
    error = 100 * float(np.mean(np.divide(errors, spans)))
    return Result(plant.name, law, error, effort)


def counted(controller: Any, step: float) -> tuple[float, float]:
    """Return the median and the largest number of instructions of a step; nan of what is no block.

    Those of an observer are of its compensator and its model, which are exported one by one.
    """
    blocks: list[Block] = []
    if isinstance(controller, Block):
        blocks = [controller]
    if isinstance(controller, DisturbanceObserver):
        blocks = [controller.compensator, controller.compensator.inverse()]
    found = [emulate(block, sample_time=step).instructions[1:] for block in blocks]
    if not found:
        return np.nan, np.nan
    return sum(float(np.median(one)) for one in found), sum(float(one.max()) for one in found)


class Published(NamedTuple):
    """An error of following a motion that a paper gives, of a span that it gives too, or nan."""

    plant: str
    controller: str
    measure: str
    error: float
    span: float
    unit: str
    source: str


SDIHC = "[Appl. Sci. 14, 10240 (2024), Table 5](https://doi.org/10.3390/app142210240)"
SINE, BELLOWS = "three parallel muscles, sine of 12 mm, 0.02 Hz", "bellows joint, steps of 60°"
HOFER = (
    "[Hofer and D'Andrea, abstract](https://deepai.com/publication/iterative-learning-control-"
    "for-fast-and-accurate-position-tracking-with-a-soft-robotic-arm)"
)
QIAN = (
    "[Qian et al., IEEE Trans. Ind. Electron. (2023), abstract](https://research.manchester.ac.uk/"
    "en/publications/robust-iterative-learning-control-for-pneumatic-muscle-with-uncer)"
)
SCHAEFKE = "[Schäfke et al., IEEE RA-L (2024), abstract](https://doi.org/10.1109/LRA.2024.3495579)"
LIN = "[Lin et al., Actuators 10, 66 (2021), abstract](https://doi.org/10.3390/act10030066)"

PUBLISHED = (
    Published(SINE, "PID", "RMSE", 3.01, 12.0, "mm", SDIHC),
    Published(SINE, "inverse of each muscle's hysteresis", "RMSE", 2.31, 12.0, "mm", SDIHC),
    Published(SINE, "inverse of hysteresis and coupling", "RMSE", 0.21, 12.0, "mm", SDIHC),
    Published(BELLOWS, "feedback", "RMSE", 14.0, 60.0, "°", HOFER),
    Published(
        BELLOWS, "feedback and ILC, below 20 repetitions", "RMSE below", 2.0, 60.0, "°", HOFER
    ),
    Published("one pneumatic muscle", "ILC", "error below", 2.5, 100.0, "% of the motion", QIAN),
    Published("pneumatic arm of five joints", "MPC on a GRU", "mean", 1.2, np.nan, "°", SCHAEFKE),
    Published("muscle-driven arm, circle", "sliding mode", "largest", 11.3, np.nan, "mm", LIN),
)


PAGE = """# Controllers in closed loops

```{{index}} closed loop, PID, MPC, ILC, disturbance observer, predictive, reinforcement learning
```

Free motions followed on {count} plants of textbook physics (`tests/plants`), none of which is a model of
this package. The compensator is the one that `mckibben study` hands over for the plant's training
recordings; + is what is added to it: PID, a disturbance observer, preview of the motion (MPC), or
{repetitions} repetitions of it (ILC). PID is tuned on the fitted model. Sensors have the plant's noise.
The *policy* is learned by reinforcement on the fitted model, which the compensator inverts: proximal
policy optimisation of stable-baselines3, {training:g} s of processor time, median of {seeds} seeds. It
sees the reference up to {ahead:g} s ahead, the last measurements and the last commands; in its training
commands lag by up to {lag:g} s. Its settings were chosen on lugre_muscle
(`benchmarks/loops_policy.py`).

Written by `python benchmarks/loops.py`.

## Error [% of range]

RMSE in per cent of the range of the motion. A loop of PID with a larger error than the static map
oscillates: the plant swings by its inertia, and the fitted model, on which PID is tuned, has none.

| plant | {laws} |
|---|{dashes}
{errors}
| median | {medians} |
| plants | {counts} |

## Effort and instructions

*Effort* is the RMS rate of the commands [bar/s or V/s]. *Instructions* are those of a step of the
exported C in single precision on an emulated Cortex-M4F, as for
[all blocks](../deploy/microcontroller.md), whose test inputs are not the motion: the median, and the
most, of a step; all are medians over the plants. A chip of 100 MHz executes about 100 in a microsecond.
The observer's are those of its compensator and its model, which are exported one by one; the static map
and the policy are no blocks, and are not exported.

| controller | effort | instructions, median | most | plants with C |
|---|---:|---:|---:|---:|
{efforts}

## Published errors

Other plants, motions and rigs: the figures show what is usual, and rank nothing. *% of range* is the
error in per cent of the range of the motion, where the source gives that.

| plant | controller | error | % of range | source |
|---|---|---:|---:|---|
{published}
{reasons}"""


def page(found: Sequence[Result]) -> str:
    """Return the page of all results."""
    laws, plants = [*TITLES], list(dict.fromkeys(one.plant for one in found))
    table = {(one.plant, one.law): one for one in found}

    def column(law: str, key: str) -> list[float]:
        values = [getattr(one, key) for one in found if one.law == law]
        return [value for value in values if np.isfinite(value)]

    def median(law: str, key: str) -> float:
        values = column(law, key)
        return float(np.median(values)) if values else np.nan

    def cells(values: Iterable[float]) -> str:
        return " | ".join(numeral(value, 2) for value in values)

    def whole(value: float) -> str:
        return f"{value:.0f}" if np.isfinite(value) else "-"

    def error(plant: str, law: str) -> float:
        return table[plant, law].error if (plant, law) in table else np.nan

    efforts = [
        f"| {TITLES[law]} | {numeral(median(law, 'effort'), 2)} | "
        f"{whole(median(law, 'instructions'))} | {whole(median(law, 'most'))} | "
        f"{len(column(law, 'most'))} |"
        for law in laws
    ]
    published = [
        f"| {one.plant} | {one.controller} | {one.measure} {one.error:g} {one.unit} | "
        f"{'< ' * one.measure.endswith('below')}{numeral(100 * one.error / one.span, 2)} | "
        f"{one.source} |"
        for one in PUBLISHED
    ]
    reasons: dict[str, list[str]] = {}
    for one in found:
        if one.reason:
            reasons.setdefault(one.reason, []).append(f"{one.plant} ({TITLES[one.law]})")
    listed = [f"- {', '.join(where)}: {why}" for why, where in reasons.items()]
    rows = [f"| {plant} | {cells(error(plant, law) for law in laws)} |" for plant in plants]
    return PAGE.format(
        count=len(plants),
        repetitions=REPETITIONS,
        training=TRAINING,
        seeds=SEEDS,
        ahead=max(AHEAD),
        lag=LAG,
        laws=" | ".join(TITLES[law] for law in laws),
        dashes="---:|" * len(laws),
        errors="\n".join(rows),
        medians=cells(median(law, "error") for law in laws),
        counts=" | ".join(str(len(column(law, "error"))) for law in laws),
        efforts="\n".join(efforts),
        published="\n".join(published),
        reasons="\n".join(
            ["", "## Without a result, or not exported", "", *listed, ""] if listed else [""]
        ),
    )


def read() -> list[Result]:
    """Return the results of the table's file, if there is one."""
    if not TABLE_FILE.exists():
        return []
    with TABLE_FILE.open(encoding="utf-8", newline="") as file:
        return [
            Result(
                plant, law, float(error), float(effort), float(instructions), float(most), reason
            )
            for plant, law, error, effort, instructions, most, reason in list(csv.reader(file))[1:]
        ]


def write(found: Sequence[Result]) -> None:
    """Write results to the table's file and the page, in the order of plants and controllers."""
    plants, laws = [*PLANTS], [*TITLES]
    found = sorted(found, key=lambda one: (plants.index(one.plant), laws.index(one.law)))
    with TABLE_FILE.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [one.name for one in fields(Result)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(one) for one in found)
    PAGE_FILE.write_text(page(found), encoding="utf-8")


def main() -> None:
    """Run controllers on plants, and write the table and the page after each plant."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--only", nargs="+", choices=list(TITLES), default=list(TITLES))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--page", action="store_true", help="write the page of the stored results")
    given = parser.parse_args()
    if given.page:
        write(read())
        return
    if missing := missing_tools():
        parser.error(f"not on this machine: {', '.join(missing)}")
    warnings.simplefilter("ignore")
    for name in given.plants:
        new: list[Result] = []
        try:
            for one in results(name, given.seed, given.only):
                new.append(one)
                print(one, flush=True)
        except MckibbenError as error:
            new += [
                Result(name, law, reason=str(error))
                for law in given.only
                if law not in [one.law for one in new]
            ]
            print(name, error, flush=True)
        done = {(one.plant, one.law) for one in new}
        write([*new, *(one for one in read() if (one.plant, one.law) not in done)])


if __name__ == "__main__":
    main()
