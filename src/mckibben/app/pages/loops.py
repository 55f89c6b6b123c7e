"""What came of closed loops: all of them in a table, and pictures of those that are ticked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from nicegui import ui

from mckibben.app import plots
from mckibben.app.desk import Desk, caution, named
from mckibben.app.drawn import picture
from mckibben.app.kept import Followed
from mckibben.app.pages.kept_curves import going
from mckibben.app.pages.leaderboard import STAYING
from mckibben.arrays import Array
from mckibben.errors import MckibbenError
from mckibben.files import read
from mckibben.numerals import number
from mckibben.report.drawing import series_colour

DRAWN = 4
"""The newest runs of a motion, which are drawn until a user ticks others."""

NOTABLE = 0.7
"""Share of the RMSE above which an offset, or what a plant's band drew, is most of it."""

OFFSET = (
    "most of the error is one offset of {}: the plant begins on another branch, or rests elsewhere, "
    "than the compensator's model. On a rig give it a zero first, or add feedback (feedforward-pid)."
)

COLUMNS = {
    "title": "Run",
    "motion": "Motion",
    "rmse": "RMSE",
    "without": "RMSE without compensation",
    "largest": "Largest error",
    "clipped": "Steps at a limit or out of reach",
    "step": "Step [µs]",
    "name": "Kept as",
}


class Ticks:
    """Which runs are drawn: the newest of a motion; when a user has ticked some, those and newer."""

    def __init__(self) -> None:
        self._chosen: list[str] | None = None
        self._seen: set[str] = set()

    def of(self, newest: list[str], usual: list[str]) -> list[str]:
        """Return the runs to draw, of all that there are and those that are drawn by themselves."""
        if self._chosen is None:
            return usual
        return [name for name in newest if name in self._chosen or name not in self._seen]

    def choose(self, names: Iterable[str], newest: Iterable[str]) -> None:
        """Take what a user has ticked of all that there are."""
        self._chosen, self._seen = list(names), set(newest)


def build(desk: Desk, model: str, drawn: Callable[[], str], ticks: Ticks) -> None:
    """Show what came of loops with a model, as they end.

    Parameters
    ----------
    desk : Desk
    model : str
        What was inverted.
    drawn : callable
        Returns the file of the motion that is drawn now, empty where none is known.
    ticks : Ticks
        What a user has ticked before.
    """

    @ui.refreshable
    def waiting() -> None:
        loops = [job for job in desk.jobs.jobs.values() if job.kind == "loop"]
        going(desk, [job for job in loops if job.given.get("model") == model])

    @ui.refreshable
    def shown() -> None:
        found = _newest_first(desk, desk.workspace.runs(model))
        if not found:
            return
        of = {name: run.reference for name, run in found.items()}
        motions = {reference: _motion(reference, drawn()) for reference in of.values()}
        titles = _titles(found)
        latest = drawn() if drawn() in motions else next(iter(motions))
        alike = [name for name in found if of[name] == latest]
        table = _table(found, motions, titles)
        # before it is listened to: what is drawn by itself is nobody's choice
        table.selected = [
            row for row in table.rows if row["name"] in ticks.of(list(found), alike[:DRAWN])
        ]
        if len(motions) > 1 or drawn() not in ("", latest):
            text = "Errors compare only within a motion: tick the runs that are to be drawn."
            named(ui.label(text).classes("text-sm"), "motions")
        for text, names in _remarks(found).items():
            if names:
                named(caution(f"{', '.join(titles[n] for n in names)}: {text}"), "runs-remark")
        for note in dict.fromkeys(note for run in found.values() for note in run.notes):
            named(caution(note), "loop-note")
        place = ui.column().classes("w-full gap-1")

        def draw() -> None:
            ticked = {row["name"] for row in table.selected}
            place.clear()
            with place:
                _pictures(desk, {n: r for n, r in found.items() if n in ticked}, motions, titles)

        def choose() -> None:
            ticks.choose([row["name"] for row in table.selected], found)
            draw()

        table.on_select(choose)
        draw()

    desk.when("jobs", waiting.refresh)
    desk.when("runs", shown.refresh)
    waiting()
    shown()


def _newest_first(desk: Desk, runs: dict[str, Followed]) -> dict[str, Followed]:
    """Return runs by when they ended."""
    paths = {name: desk.workspace.path("runs", f"{name}.json") for name in runs}
    ended = {name: path.stat().st_mtime_ns for name, path in paths.items() if path.is_file()}
    return {name: runs[name] for name in sorted(ended, key=lambda name: -ended[name])}


def _titles(runs: dict[str, Followed]) -> dict[str, str]:
    """Return what runs are called: by law and plant, and what was held; else also by their names."""
    titles = {name: ", ".join([_what(run), *_held(run)]) for name, run in runs.items()}
    many = Counter(titles.values())
    return {
        name: title if many[title] == 1 else f"{title} ({name})" for name, title in titles.items()
    }


def _what(run: Followed) -> str:
    form = "" if run.form == "inverse" else f" ({run.form})"
    return f"{run.controller or 'loop'}{form} on {run.plant or run.rig}"


def _held(run: Followed) -> list[str]:
    """Return what was held beside the motion, such as a load, in words."""
    return [
        f"{name} {'moving' if value is None else _listed({name: value}, run.units)}"
        for name, value in run.held.items()
    ]


def _remarks(runs: dict[str, Followed]) -> dict[str, list[str]]:
    """Return what the figures of runs do not say, and of which."""
    no_better, scattering, offsets = [], [], dict[str, list[str]]()
    for name, run in runs.items():
        plain = run.uncompensated
        pairs = [(run.rmse[key], plain.get(key)) for key in run.rmse]
        if any(own is not None and other is not None and own >= other for own, other in pairs):
            no_better.append(name)
        for channel, rmse in run.rmse.items():
            offset, scatter = run.offset.get(channel), run.scatter.get(channel)
            if rmse and offset is not None and abs(offset) > NOTABLE * rmse:
                text = OFFSET.format(_listed({channel: offset}, run.units))
                offsets.setdefault(text, []).append(name)
            elif rmse and scatter is not None and scatter > NOTABLE * rmse:
                scattering.append(name)
    return offsets | {
        "no better than without compensation.": no_better,
        "the plant scatters as its band says, which no compensator foresees.": scattering,
    }


def _motion(reference: str, drawn: str) -> str:
    """Return what a motion is called: its file, and whether it is the one that is drawn."""
    name = reference.removesuffix(".csv") or "unknown"
    if not drawn:
        return name
    return f"{name}, as drawn" if reference == drawn else f"{name}, another"


def _table(runs: dict[str, Followed], motions: dict[str, str], titles: dict[str, str]) -> ui.table:
    """Show runs, those of the same motion together."""
    rows: list[dict[str, Any]] = [
        {"name": name, "title": titles[name], "motion": motions[run.reference]}
        | {"rmse": _listed(run.rmse, run.units), "without": _listed(run.uncompensated, run.units)}
        | {"largest": _listed(run.largest, run.units), "clipped": run.clipped}
        | {"step": number(run.step_us, 2)}
        for reference in motions
        for name, run in runs.items()
        if run.reference == reference
    ]
    columns = [
        {"name": key, "field": key, "label": label, "align": "left"}
        | (STAYING if key == "title" else {})
        for key, label in COLUMNS.items()
    ]
    table = ui.table(rows=rows, columns=columns, row_key="name", selection="multiple")
    return named(table.props("dense flat wrap-cells").classes("w-full"), "runs")


def _listed(values: dict[str, float | None], units: dict[str, str]) -> str:
    known = [f"{number(value, 3)}\xa0{units.get(name, '')}" for name, value in values.items()]
    return ", ".join(text.strip() for text in known) or "none"


def _pictures(
    desk: Desk, runs: dict[str, Followed], motions: dict[str, str], titles: dict[str, str]
) -> None:
    """Draw runs, and what no compensation did: a picture for every coordinate of every motion."""
    curves: dict[tuple[str, bytes], list[tuple[str, Array, Array, str]]] = {}
    about: dict[tuple[str, bytes], tuple[str, str]] = {}
    uncompensated: set[str] = set()
    # from the oldest of all, so that a newer run changes no other's colour
    colours = {name: series_colour(place) for place, name in enumerate(reversed(titles))}
    for name in runs:
        try:
            (run,) = read(desk.workspace.path("runs", f"{name}.csv"), informative=False)
        except (MckibbenError, ValueError):
            continue
        if run.duration is not None and run.start_time < 0:  # the approach is not scored
            run = run.slice(round(-run.start_time / (run.sample_time or 1.0)), len(run))
        # what is asked for at a step is due, and recorded, at the next: drawn as it was planned
        time = run.time - (run.sample_time or 0.0)
        of = runs[name]
        there = ", ".join([of.plant or of.rig, *_held(of)])
        for channel in of.rmse:
            wished, plain = f"reference_{channel}", f"uncompensated_{channel}"
            if channel not in run or wished not in run:
                continue
            # under another load the same motion has another file
            key = channel, run[wished].tobytes()
            about.setdefault(key, (f"{channel} [{run.units[channel]}]", motions[of.reference]))
            own = curves.setdefault(key, [("reference", time, run[wished], "measured")])
            without = f"no compensation on {there}"
            if plain in run and not any(curve[0] == without for curve in own):
                uncompensated.add(without)
                own.append((without, time, run[plain], "muted"))
            own.append((titles[name], time, run[channel], colours[name]))
    if not curves:
        ui.label("Tick a run to see it.").classes("opacity-70")
    several = len(curves) > len({channel for channel, _ in curves})
    for place, (key, own) in enumerate(curves.items()):
        label, motion = about[key]
        if several:
            ui.label(f"Motion {motion}").classes("text-sm")
        figure = plots.lines(own, x="time [s]", y=label, dotted=uncompensated)
        picture(desk, figure, "loop-runs" if not place else f"loop-runs-{place + 1}")
