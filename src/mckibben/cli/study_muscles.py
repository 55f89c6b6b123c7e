"""mckibben study, where there are several muscles: a model chosen, tested, inverted, a loop closed."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.atomic import to_json
from mckibben.blocks.saving import to_text
from mckibben.cli.leaderboards import told
from mckibben.cli.options import parse_settings
from mckibben.cli.output import figure, print_json, print_table, progress_bar, say
from mckibben.cli.stopping import forget_kept
from mckibben.errors import DataError
from mckibben.report.results_folder import model_file, study_files

if TYPE_CHECKING:
    from mckibben.comparison.muscles import MuscleRow
    from mckibben.control import Tracked
    from mckibben.outputs import Results
    from mckibben.papers.reproduction import Cell
    from mckibben.recording import Recording

LOADED = ("coupled-memory", "force-balance", "mpi-narmax")
"""Models that are told the load."""

LONGEST = 200.0
"""Of the reference that a loop is closed on [s]."""


def study_muscles(
    recordings: Sequence[Recording],
    validation: Sequence[Recording],
    tests: Sequence[Recording],
    kept: Results,
    models: str | Sequence[str],
    settings: list[str] | None,
    rig: str | None,
    load: str | None,
    seed: int,
    jobs: int | None,
    as_json: bool,
    allow_shared: bool,
) -> None:
    """Choose a model of several muscles, test it, invert the first that can be, track, and report."""
    from mckibben import registry
    from mckibben.comparison.muscles import (
        QUICK,
        compare_muscles,
        constant_row,
        held_out_levels,
        in_order,
        per_load,
        shared_runs,
        validation_of,
    )
    from mckibben.comparison.recommending import acceptable, recommended
    from mckibben.recording import reading_notes

    train, split = list(recordings), "as given"
    if not tests:
        train, tests, split = held_out_levels(train)
    if load is not None:
        models = LOADED if isinstance(models, str) else models
        for run in (*train, *tests):
            if load not in run:
                raise DataError(
                    "there is no such channel to tell the load",
                    file=run.source,
                    channel=load,
                    remedy="name it with --column, or leave --load out",
                )
    if isinstance(models, str):
        models = QUICK if models == "quick" else registry.names("coupled")
    given = {name: parse_settings(settings, name, group="coupled") for name in models}
    if not tests:
        raise DataError("there is no run to test on", remedy="give --test, or more runs")
    kept.claim(study_files(models))
    folder = kept.folder
    results = _Results(
        kept,
        f"fitted to {len(train)} runs, tested on {len(tests)}: {split}",
        validation_of(train, validation).described,
        tests,
        shared_runs(train, validation, tests, allow=allow_shared),
        reading_notes([*recordings, *validation, *tests]),
        constant_row(train, tests, validation),
    )
    results.command = f"mckibben study FILES{'' if load is None else f' --load {load}'} -o {folder}"
    results.so_far([])
    plant = rig or _rig_of(recordings)
    loops: dict[str, Tracked] = {}
    with progress_bar("studying", plainly=True) as tell:
        rows = compare_muscles(
            train,
            tests,
            validation=validation,
            models=models,
            settings={
                name: ({} if load is None else {"scheduling": (load,)}) | own
                for name, own in given.items()
            },
            seed=seed,
            jobs=jobs,
            allow_shared=allow_shared,
            folder=folder,
            progress=told(lambda share, text: tell(0.8 * share, text)),
            found=results.so_far,
        )
        if load is not None and rows[0].block is not None:
            tell(0.8, "one model for every load")
            driven = rows[0].block.inputs[0].name
            single = per_load(
                train,
                tests,
                validation=validation,
                load=load,
                input=driven,
                seed=seed,
                jobs=jobs,
            )
            rows = in_order((*rows, *single))
        best = None
        if recommended(rows, results.constant, "mm")[0] is not None:
            able = (row for row in rows if row.inverse is not None)
            best = next((row for row in able if acceptable(row, results.constant)), None)
        if best is not None and plant is not None:
            tell(0.85, "closing loops")
            loops = _loops(best, rows, plant, tests, seed)
    result = results.take(rows, best, loops, plant)
    if best is not None and best.inverse is not None:
        kept.write_text("inverse.json", to_text(best.inverse))
    if as_json:
        print_json(result)
        forget_kept(folder)
        return
    for table in _tables(rows, results.constant, loops):
        say(f"\n{table.title}")
        cells = [[_cell(cell) for cell in row] for row in table.rows]
        print_table(list(table.columns), cells)
        if table.note:
            say(table.note)
    say()
    for sentence in (*results.summary(rows, best, loops, plant), *results.shared, *results.notes):
        say(sentence)
    say(
        f"Written: {folder / 'report.html'}, leaderboard.csv, leaderboard.json, models"
        + ("" if best is None or best.inverse is None else ", inverse.json")
    )
    forget_kept(folder)


class _Results:
    """The folder of results, written as models are finished."""

    command = ""

    def __init__(
        self,
        kept: Results,
        split: str,
        chosen_on: str,
        tests: Sequence[Recording],
        shared: Sequence[str],
        notes: Sequence[str],
        constant: MuscleRow,
    ) -> None:
        self._kept, self._split, self._tests = kept, split, tests
        self.chosen_on, self.shared, self.constant = chosen_on, shared, constant
        self.notes = notes
        kept.clear()  # of an earlier study

    def so_far(self, rows: Sequence[MuscleRow]) -> None:
        """Write what is finished, while more models are fitted."""
        self.take(rows, None, {}, None, whole=False)

    def summary(
        self,
        rows: Sequence[MuscleRow],
        best: MuscleRow | None,
        loops: Mapping[str, Tracked],
        plant: str | None,
    ) -> list[str]:
        """Return in words what is chosen, what comes of it, and why where nothing is."""
        return _summary(rows, self.constant, best, loops, plant, self.chosen_on)

    def take(
        self,
        rows: Sequence[MuscleRow],
        best: MuscleRow | None,
        loops: Mapping[str, Tracked],
        plant: str | None,
        whole: bool = True,
    ) -> dict[str, Any]:
        """Write models, leaderboard and report as far as they are; return the leaderboard."""
        from mckibben.comparison.recommending import recommended
        from mckibben.papers.reproduction import Reproduction
        from mckibben.report.reproduction import reproduction_page

        if rows:
            _write(rows, self._kept)
        summary = ["Models are being fitted."]
        if whole:
            summary = [*self.summary(rows, best, loops, plant), *self.shared]
        found = Reproduction(
            name="study",
            title="Several muscles: models, inverses and loops",
            summary=tuple(summary),
            tables=_tables(rows, self.constant, loops) if rows else (),
            figures=_figures(rows, self._tests, loops),
            notes=(
                f"{self._split[0].upper()}{self._split[1:]}.",
                f"Chosen on {self.chosen_on}: that orders the table. Nothing is chosen by the test.",
                "Every figure is free-running"
                + (", on data fitted to." if self.shared else ", on runs not used to fit."),
                "constant is the mean of the training output, which every model has to beat.",
                *(
                    f"{name}: good only near the motions fitted, {why}."
                    for name, why in _careful(rows)
                ),
                *self.notes,
            ),
            lead="Models of muscles that move one another, chosen on the training side, then tested.",
            notes_title="How it was done",
            command=self.command,
        )
        self._kept.write_text("report.html", reproduction_page(found))
        chosen, objection = recommended(rows, self.constant, "mm")
        result = {
            "folder": str(self._kept.folder),
            "split": self._split,
            "chosen_on": self.chosen_on,
            "notes": list(self.notes),
            "chosen": None if chosen is None else chosen.model,
            "not_recommended": objection or None,
            "shared": list(self.shared),
            "rows": [row.to_dict() for row in _with(rows, self.constant)],
            "inverse": None if best is None else best.model,
            "tracking": {name: dict(tracked.rmse) for name, tracked in loops.items()},
        }
        self._kept.write_text("leaderboard.json", to_json(result) + "\n")
        return result


def _with(rows: Sequence[MuscleRow], constant: MuscleRow) -> list[MuscleRow]:
    """Return rows with the constant in its place by validation."""
    place = sum(
        row.block is not None and row.mean_validation <= constant.mean_validation for row in rows
    )
    return [*rows[:place], constant, *rows[place:]]


def _cell(cell: Any) -> str:
    if cell is None:
        return "-"
    return figure(cell, 3) if isinstance(cell, float) else str(cell)


def _rig_of(recordings: Sequence[Recording]) -> str | None:
    """Return the published rig that recordings say they come from."""
    from mckibben.errors import MckibbenError
    from mckibben.rigs import load_rig

    named = str(recordings[0].meta.get("rig", "")).partition(" ")[0]
    try:
        return load_rig(named).name if named else None
    except MckibbenError:
        return None


def _loops(
    best: MuscleRow, rows: Sequence[MuscleRow], plant: str, tests: Sequence[Recording], seed: int
) -> dict[str, Tracked]:
    """Return what came of following a measured motion with every inverse, with PID, and with both.

    Nothing is chosen by it: the model that is to predict is the one that is inverted.
    """
    from mckibben.control import Controller, Feedforward, FeedforwardPID, track, tune_pid
    from mckibben.errors import MckibbenError
    from mckibben.recording import Recording
    from mckibben.rigs import load_rig

    rig = load_rig(plant)
    moves = list(best.test)
    wanted = {c.name for row in rows if row.inverse is not None for c in row.inverse.inputs}
    held = [name for name in rig.inputs if name in wanted]
    model = max(tests, key=lambda run: min(float(np.ptp(run[name])) for name in moves))
    step = model.sample_time or 0.05
    n = min(len(model), round(LONGEST / step))
    width = max(round(0.5 / step), 1)
    smooth = {
        name: np.convolve(
            np.pad(model[name][:n], width, mode="edge"), np.ones(width) / width, "same"
        )[width : width + n]
        for name in moves
    }
    reference = Recording(
        smooth | {name: np.full(n, float(model[name].mean())) for name in held}, step
    )
    scheduled = {name: float(reference[name][0]) for name in held}
    pid = tune_pid(rig, sample_time=step, scheduled=scheduled, seed=seed)
    found: dict[str, Tracked] = {}

    def follow(name: str, controller: Controller) -> None:
        with suppress(
            MckibbenError
        ):  # an inverse that fails is left out; its model is in the table
            found[name] = track(controller, rig, reference, approach=5.0, seed=seed)

    for row in rows:
        if row.inverse is not None:
            follow(f"{row.model} inverse", Feedforward(row.inverse))
    follow("PID", pid)
    if best.inverse is not None:
        follow(f"{best.model} inverse + PID", FeedforwardPID(best.inverse, pid))
    return found


def _write(rows: Sequence[MuscleRow], kept: Results) -> None:
    outputs = list(rows[0].test)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    kinds = [f"{kind}_rmse_{name}" for kind in ("validation", "test") for name in outputs]
    writer.writerow(["model", *kinds, "test_rank", "worst", "n_parameters", "reason"])
    for row in rows:
        errors = [kind.get(name, "") for kind in (row.validation, row.test) for name in outputs]
        reason = row.reason or row.invalid or ""
        writer.writerow([row.model, *errors, row.test_rank, row.worst, row.n_parameters, reason])
        if row.block is not None:
            kept.write_text(model_file(row.model), to_text(row.block))
    kept.write_text("leaderboard.csv", text.getvalue())


def _summary(
    rows: Sequence[MuscleRow],
    constant: MuscleRow,
    best: MuscleRow | None,
    loops: Mapping[str, Tracked],
    plant: str | None,
    chosen_on: str,
) -> list[str]:
    from mckibben.comparison.recommending import recommended

    first, objection = recommended(rows, constant, "mm")
    if objection:
        return [f"{objection}.", "No inverse is written, and no loop closed."]
    if first is None:
        return [f"No model could be fitted: {rows[0].reason}"]
    lowest = min(rows, key=lambda row: row.mean)
    by = f"on {chosen_on}: {first.model}, {first.mean_validation:.3g} mm RMSE"
    if not first.validation:
        by = f"by its fit, since no model could be validated: {first.model}"
    other = (
        "the lowest" if lowest is first else f"lowest there: {lowest.model}, {lowest.mean:.3g} mm"
    )
    said = [
        f"Chosen {by}; on the test runs {first.mean:.3g} mm, {other}. "
        f"All are averages over {len(first.test)} displacement(s)."
    ]
    if first.caution is not None:
        said.append(f"{first.model} is good only near the motions fitted: {first.caution}.")
    if best is None:
        said.append("No model here has an inverse.")
    elif best is first:
        said.append(f"inverse.json is the inverse of {best.model}.")
    else:
        said.append(
            f"{first.model} has no inverse: inverse.json is that of {best.model}, the next that has."
        )
    if loops:
        errors = {name: max(tracked.rmse.values()) for name, tracked in loops.items()}
        listed = ", ".join(f"{name} {value:.2g} mm" for name, value in errors.items())
        said.append(f"Following a measured motion on {plant}, worst muscle's RMSE: {listed}.")
    elif plant is None:
        said.append("No loop was closed: name a virtual rig with --rig to see the inverse at work.")
    return said


def _careful(rows: Sequence[MuscleRow]) -> list[tuple[str, str]]:
    return [(row.model, row.caution) for row in rows if row.block is not None and row.caution]


def _tables(
    rows: Sequence[MuscleRow], constant: MuscleRow, loops: Mapping[str, Tracked]
) -> tuple[Any, ...]:
    from mckibben.papers.reproduction import Table

    outputs = list(rows[0].test)
    ranked: tuple[tuple[Cell, ...], ...] = tuple(
        (
            row.model + ("*" if row.caution else ""),
            row.mean_validation if row.validation else None,
            row.mean if row.test else None,
            row.test_rank,
            *(row.test.get(name) for name in outputs),
            row.worst if row.test else None,
            row.n_parameters,
            row.seconds,
            "yes" if row.inverse is not None else "no",
            row.reason or (f"not validated: {row.invalid}" if row.invalid else ""),
        )
        for row in _with(rows, constant)
    )
    careful = ", ".join(name for name, _ in _careful(rows))
    board = Table(
        "Models in the order of the choice, and on the test runs",
        (
            *("model", "validation RMSE [mm]", "test RMSE [mm]", "rank by test"),
            *(f"{name} [mm]" for name in outputs),
            *("largest error [mm]", "parameters", "fit [s]", "inverse", "failed because"),
        ),
        ranked,
        careful
        and "* Good only near the motions fitted, however small the errors, so not chosen while another "
        f"works: {careful}.",
    )
    if not loops:
        return (board,)
    tracked: tuple[tuple[Cell, ...], ...] = tuple(
        (name, *(found.rmse[y] for y in found.rmse), found.clipped) for name, found in loops.items()
    )
    names = tuple(f"{name} RMSE [mm]" for name in next(iter(loops.values())).rmse)
    return (
        board,
        Table("Following a measured motion on the rig", ("controller", *names, "clipped"), tracked),
    )


def _figures(
    rows: Sequence[MuscleRow], tests: Sequence[Recording], loops: Mapping[str, Tracked]
) -> tuple[Any, ...]:
    from mckibben.papers.reproduction import Figure, thinned

    shown = [row for row in rows if row.block is not None][:3]
    run = tests[0]
    modelled = {
        row.model: row.block.simulate(run.select([channel.name for channel in row.block.inputs]))
        for row in shown
        if row.block is not None
    }
    figures = []
    for name in shown[0].test if shown else _displacements(run):
        curves = {"measured": (thinned(run.time), thinned(run[name]))}
        curves |= {k: (thinned(run.time), thinned(v[name])) for k, v in modelled.items()}
        figures.append(Figure(f"{run.name}: {name}", "time [s]", "displacement [mm]", curves))
    if loops:
        first = next(iter(loops.values()))
        for name in first.rmse:
            reference = first.recording[f"reference_{name}"]
            curves = {"reference": (thinned(first.recording.time), thinned(reference))}
            for controller, found in loops.items():
                y = found.recording[name]
                curves[controller] = (thinned(found.recording.time), thinned(y))
            figures.append(Figure(f"Loop: {name}", "time [s]", "displacement [mm]", curves))
    return tuple(figures)


def _displacements(run: Recording) -> list[str]:
    return [name for name in run.channels if name.startswith("displacement")]


def is_of_muscles(recordings: Sequence[Recording]) -> bool:
    """Tell whether recordings are of several muscles."""
    return bool(recordings) and all(
        "pressure_1" in recording and "displacement_1" in recording for recording in recordings
    )
