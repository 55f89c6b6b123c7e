"""The leaderboard, and one model or two of it seen closer."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import fields, plots
from mckibben.app.desk import (
    Desk,
    caution,
    guarded,
    named,
    on_event,
)
from mckibben.app.drawn import picture
from mckibben.app.pages import next_steps
from mckibben.app.pages.judging import (
    RUNS,
    drawn_first,
    judged,
    of_other_data,
    share_of_mean,
    unvalidated,
)
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.equations import quantities
from mckibben.blocks.free_run import Mask, run_free
from mckibben.comparison.splits import Split, tested_from
from mckibben.errors import MckibbenError, ModelError
from mckibben.estimators.catalogue import caution as model_caution
from mckibben.estimators.catalogue import full_name
from mckibben.numerals import number, numeral, typeset
from mckibben.recording import Recording
from mckibben.report import subjects, words
from mckibben.report.columns import Column, columns_of
from mckibben.report.drawing import series_colour
from mckibben.report.words import CAREFUL, CHOICES

PARAMETERS = 12
"""Of a page of the table of parameters."""


BY_VALUE = """(a, b, one, other) => {
    const [x, y] = [one, other].map((row) => row["%s"] ?? Infinity);
    return x < y ? -1 : x > y ? 1 : 0;
}"""
"""How a column is sorted: by what its rows hold, not as it is shown."""

ABOUT = (
    "Every model is run from its inputs alone, never put right by what was measured. Models are sorted "
    "by {heading}, their error by {by}; the first is to be chosen, and nothing is chosen by the test. "
    "{careful}Width reproduced: 100 % where the model has rising and falling branches as far apart as "
    "the data, 0 where it forgot. R² counts from the test's own mean, which may lie closer where the "
    "test hardly varies. Inverse: exact by a formula, solved in every step, or none, and then "
    "there is nothing to compensate with. Select one or two models to look closer."
)

NARROW = {"classes": "!px-2", "headerClasses": "!px-2 !whitespace-normal"}
"""Of columns of figures, so that all are seen on a wide screen."""

STAYING = dict.fromkeys(
    ("classes", "headerClasses"),
    "sticky left-0 z-10 min-w-32 bg-[var(--paper)] dark:bg-[var(--q-dark)] !whitespace-normal",
)
"""Of names, which stay while the rest is scrolled on a narrow one."""

OTHER_DATA = (
    "Models marked “other data” were fitted or tested on recordings that have been added, changed, or "
    "given another role since: their errors do not compare with the others'. Fit them again."
)


def build(desk: Desk) -> None:
    """Build it."""
    # what a user has chosen stays so when the table is shown anew
    ticked: list[str] = []
    picked = {"wanted": "", "shown": ""}

    @ui.refreshable
    def shown() -> None:
        results = desk.results()
        if not results:
            others = {
                (one["input"] + (f" under {one['load']}" if one["load"] else ""), one["output"])
                for one in desk.workspace.results()
            }
            text = "Fit models to see them compared here."
            if others:
                listed = "; ".join(f"{given} to {wanted}" for given, wanted in sorted(others))
                told = "Those fitted are of other inputs, outputs or loads, chosen under Data"
                text += f" {told}: {listed}."
            ui.label(text).classes("opacity-70")
            return
        ui.label("Leaderboard").classes("text-lg")
        _of_other_data(results)
        table = _table(results, desk.outputs)
        heading, by = CHOICES[results[0]["chosen_by"]]
        cautious = any(model_caution(result["model"]) for result in results)
        careful = f"* {CAREFUL}. " if cautious else ""
        if none := unvalidated(results):
            heading, by = CHOICES["fit"]
        about = none + ABOUT.format(heading=heading, by=by, careful=careful)
        ui.label(about).classes("text-xs opacity-70")
        for said in judged(results):
            ui.label(fields.said(said)).classes("text-sm")
        run = named(ui.select({}, label="Recording").classes("min-w-52"), "closer-run")
        run.set_visibility(False)
        place = named(ui.column().classes("w-full"), "closer")

        def chosen() -> list[str]:
            return [row["name"] for row in table.selected][:2]

        async def closer() -> None:
            names, wanted = chosen(), picked["wanted"]
            draw, runs = await _closer(desk, names, wanted)
            # else a later click draws
            if (names, wanted) == (chosen(), picked["wanted"]) and not place.is_deleted:
                picked["shown"] = wanted if wanted in runs else next(iter(runs), "")
                run.set_options(runs, value=picked["shown"] or None)
                run.set_visibility(len(runs) > 1)
                place.clear()
                with place:
                    draw()

        def choose(_: Any) -> Awaitable[None]:
            ticked[:] = chosen()
            return closer()

        async def pick(_: Any) -> None:
            if run.value != picked["shown"]:
                picked.update(wanted=run.value, shown=run.value)
                await closer()

        table.on_select(on_event(choose))
        run.on_value_change(on_event(pick))
        old = desk.stale() if results[0]["current"] else set()
        kept = [row for row in table.rows if row["name"] in ticked and row["name"] not in old]
        table.selected = kept or [row for row in table.rows if row["name"] == drawn_first(results)]
        ui.timer(0.05, guarded(closer, "Running the model"), once=True)

    data = {"known": desk.workspace.data()}

    def changed() -> None:
        if data["known"] != (now := desk.workspace.data()):
            data["known"] = now
            shown.refresh()

    desk.when("recordings", changed)
    desk.when("results", shown.refresh)
    shown()


def doubts(desk: Desk, *, all_refused: bool = True) -> None:
    """Say where a model is chosen what speaks against all, in the words of the leaderboard.

    Parameters
    ----------
    desk : Desk
    all_refused : bool
        Whether to say that none is recommended, and why; else only that data have changed since.
    """

    @ui.refreshable
    def shown() -> None:
        _of_other_data(desk.results())
        if all_refused and (why := desk.not_recommended):
            named(caution(fields.said(why)), "not-recommended")

    for topic in ("results", "channels", "recordings"):
        desk.when(topic, shown.refresh)
    shown()


def _of_other_data(results: Sequence[dict[str, Any]]) -> None:
    if not all(result["current"] for result in results):
        text = ui.label(OTHER_DATA).classes("text-sm text-amber-900 dark:text-amber-300")
        named(text, "other-data")


def _table(results: Sequence[dict[str, Any]], outputs: Sequence[str]) -> ui.table:
    columns = columns_of(results, results[0]["unit"], outputs, results[0]["chosen_by"])
    listed = (("title", "model"), *((c.key, c.label) for c in columns))
    table = ui.table(
        rows=[_row(result, columns) for result in results],
        columns=[
            {"name": key, "label": label, "field": key, "sortable": True}
            | {"align": "left" if key == "title" else "right", ":sort": BY_VALUE % f"{key}_by"}
            | (STAYING if key == "title" else NARROW)
            for key, label in listed
        ],
        row_key="name",
        selection="multiple",
    )
    return named(table.classes("w-full").props("dense flat"), "leaderboard")


def _row(result: dict[str, Any], columns: Sequence[Column]) -> dict[str, Any]:
    ran = (
        share_of_mean(result) > RUNS
    )  # else the test is far from all that was trained on, mean and all
    shown: dict[str, Any] = {
        column.key: typeset(column.text(result)) + ran * f" {column.flag(result)}".rstrip()
        for column in columns
    }
    shown |= {f"{column.key}_by": column.sorted_by(result) for column in columns}
    full = full_name(result["model"])
    title = result["name"] if full == result["name"] else f"{result['name']}: {full}"
    title += "*" * bool(model_caution(result["model"])) + of_other_data(result)
    title += " (not recommended)" * bool(result["not_recommended"])
    return {"name": result["name"], "title": title, "title_by": title} | shown


async def _closer(
    desk: Desk, names: list[str], wanted: str
) -> tuple[Callable[[], None], dict[str, str]]:
    """Return what draws one model or two on a recording wanted, or the first, and all recordings.

    It draws measured against modelled, residuals and parameters.
    """
    if not names:
        return lambda: None, {}
    split = await asyncio.to_thread(desk.split)
    parts = _parts(split, old=bool(desk.stale().intersection(names)))
    one = parts.get(wanted) or next(iter(parts.values()))
    recording, known = one.recording, split.train
    blocks = {name: desk.workspace.model(name) for name in names}

    def modelled() -> tuple[dict[str, Array], dict[str, Array]]:
        found = {
            name: run_free(block, recording, desk.outputs, known) for name, block in blocks.items()
        }
        return found, _bands(desk, recording, found)

    try:
        outputs, bands = await asyncio.to_thread(modelled)
        pairs = await asyncio.to_thread(desk.looked_at, [recording])
    except MckibbenError as error:
        problem = f"{', '.join(names)} on {recording.name}: {error.problem}"
        raise ModelError(problem, remedy=error.remedy) from None
    measured = recording.matrix(desk.outputs)
    off = {  # the mean over outputs, as in the leaderboard
        name: float(np.sqrt(np.mean((found - measured)[one.rows] ** 2, axis=0)).mean())
        for name, found in outputs.items()
    }
    unit = recording.units[desk.outputs[0]]

    def draw() -> None:
        next_steps.buttons(desk, names[0])
        errors = "; ".join(f"{name} {number(rmse, 3)} {unit}" for name, rmse in off.items())
        where = " of that part" if one.part is not None else ""
        named(ui.label(f"On {one.title}. RMSE{where}: {errors}."), "closer-on")
        tested = {row["name"]: row["band"] for row in desk.results() if row["band"]}
        for name in (name for name in bands if name in tested):
            band = tested[name]
            for sentence in words.band_on_test(
                band["level"], band["coverage"], band["width"], band["unit_of_width"]
            ):
                named(ui.label(f"{name}: {sentence}").classes("text-sm"), "closer-band")
        drawings = []
        for output, pair in enumerate(pairs):
            own = {name: found[:, output] for name, found in outputs.items()}
            drawings += [
                subjects.against("fit", recording, pair, own, one.part),
                subjects.against("loops", recording, pair, own),
                subjects.against("residuals", recording, pair, own, one.part),
            ]
        for index, drawing in enumerate(drawings):
            with ui.row().classes("w-full"):
                for place, figure in enumerate(plots.figures(drawing, height=360)):
                    # over time: the first drawing of an output, and the last half of its residuals
                    output, kind = divmod(index, 3)
                    for name, ends in bands.items() if (kind, place) in ((0, 0), (2, 1)) else ():
                        centre = outputs[name][:, output] if kind else 0.0
                        low, high = ends[:, output].T - centre
                        colour = series_colour(list(blocks).index(name))
                        label = f"band of {name}"
                        plots.shaded(figure, recording.time, (low, high), colour, label)
                    figure["layout"]["showlegend"] = True
                    plot = picture(desk, figure, f"closer-{index}")
                    plot.classes("flex-1 min-w-72", remove="w-full")
        with ui.row().classes("w-full items-start"):
            for name, block in blocks.items():
                with ui.expansion(f"Parameters of {name}").classes("flex-1 min-w-72"):
                    named(_parameters(block), f"parameters-{name}")

    return draw, {name: each.title for name, each in parts.items()}


def _bands(desk: Desk, recording: Recording, modelled: dict[str, Array]) -> dict[str, Array]:
    """Return the lower and upper ends, shape (n, k, 2), of the models' outputs that have a band."""
    found = {}
    for name, outputs in modelled.items():
        band = desk.workspace.band(name)
        # of a band of other channels, nothing is told of these
        if band is None or tuple(c.name for c in band.given) != tuple(desk.outputs):
            continue
        ends = band.simulate(outputs, sample_time=recording.sample_time)
        found[name] = ends.reshape(*outputs.shape, 3)[:, :, 1:]
    return found


@dataclass(frozen=True, eq=False)
class Part:
    """A recording that models are run on, what is judged of it, and from where that is tested."""

    recording: Recording
    title: str
    rows: Mask
    part: int | None = None


def _parts(split: Split, *, old: bool) -> dict[str, Part]:
    """Return all recordings, those tested on first, and what a fit does with each.

    Parameters
    ----------
    split : Split
    old : bool
        Whether models are looked at of other data, of which something else was held out.
    """
    found = {}
    for run, rows in zip(split.test, split.test_rows, strict=True):
        part = None if old else tested_from(rows)
        use = ", a test recording" if part is None else f", in part {subjects.HELD_OUT}"
        found[run.name] = Part(run, f"{run.name}{'' if old else use}", rows, part)
    for run in split.train:
        title = f"{run.name}{'' if old else ', trained on'}"
        found.setdefault(run.name, Part(run, title, np.ones(len(run), dtype=bool)))
    return found


def _parameters(block: Block) -> ui.table:
    """Show every number of a model, to four digits, with its unit and what it is."""
    rows = [
        {
            "name": one.name,
            "value": typeset(numeral(value, 4)),
            "unit": one.unit or "–",
            "meaning": one.meaning,
        }
        for one, value in zip(quantities(block), block.pack().tolist(), strict=True)
    ]
    columns = [
        {"name": key, "label": label, "field": key, "align": "right" if key == "value" else "left"}
        for key, label in (
            ("name", "parameter"),
            ("value", "value"),
            ("unit", "unit"),
            ("meaning", "what it is"),
        )
    ]
    table = ui.table(rows=rows, columns=columns, row_key="name", pagination=PARAMETERS)
    return table.classes("w-full").props("dense flat wrap-cells")
