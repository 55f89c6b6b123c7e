"""A reference: drawn on axes, written as numbers, ready-made, or loaded from a file."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

import numpy as np
from nicegui import ui
from nicegui.events import MouseEventArguments, UploadEventArguments

from mckibben.app import motions, plots
from mckibben.app.desk import Desk, kept, labelled, named, on_event, told
from mckibben.app.dropping import drop_zone
from mckibben.app.motions import Points
from mckibben.app.pages.axes import HEIGHT, WIDTH, Axes
from mckibben.app.reading import read_upload
from mckibben.blocks.fields import Channel
from mckibben.errors import DataError
from mckibben.recording import Recording

ROWS = 60
"""Most points in the table; the text holds them all."""

NEAR = 9.0
"""Distance within which a point is taken hold of [px]."""

SNAPS = 40
"""Lines that points snap to, at most, in each direction."""

UNDONE = 100
"""Changes that can be taken back."""


CYCLES = 2
"""Of a ready-made motion, unless others are wished for."""


class Sketch:
    """A reference for every coordinate of a model.

    Parameters
    ----------
    desk : Desk
    channels : sequence of Channel
        What is to be wished for.
    reach : mapping of str to (float, float)
        What can be reached of each.
    rest : mapping of str to float
        Where each is at rest.
    held : mapping of str to float
        What a compensator needs beside, as it is held.
    units : mapping of str to str
        Of all these.
    cycle : float
        How long one usually takes [s].
    changed : callable
        Told of every change.
    """

    def __init__(
        self,
        desk: Desk,
        channels: Sequence[Channel],
        reach: dict[str, tuple[float, float]],
        rest: dict[str, float],
        held: dict[str, float],
        units: dict[str, str],
        cycle: float,
        changed: Callable[[], None],
    ) -> None:
        self.changed, self.usual = changed, float(f"{CYCLES * cycle:.2g}")
        self.rest = {name: rest.get(name, ends[0]) for name, ends in reach.items()}
        self.desk, self.channels, self.reach = desk, {c.name: c for c in channels}, reach
        self.units = {channel.name: channel.unit for channel in channels} | units
        self.points: dict[str, Points] = {name: [] for name in self.channels}
        self.file: Recording | None = None
        self.now = next(iter(self.channels))
        self._before: list[tuple[dict[str, Points], Recording | None]] = []
        self._taken: tuple[float, float] | None = None
        self._quiet, self._changes = False, 0
        self._build(held)
        desk.when("theme", self.draw)
        self._span()
        self.draw()

    # -- what is on the page -------------------------------------------------------------------

    def _build(self, held: dict[str, float]) -> None:
        ui.label("Reference").classes("text-lg")
        if len(self.channels) > 1:
            toggle = ui.toggle(list(self.channels), value=self.now).props("dense no-caps")
            named(toggle, "coordinate").on_value_change(lambda event: self._turn(str(event.value)))
        self.hint = ui.label().classes("text-xs opacity-70")
        self.frame = named(
            ui.interactive_image(
                size=(WIDTH, HEIGHT),
                cross=True,
                on_mouse=self._mouse,
                events=["mousedown", "mouseup"],
            )
            .classes("w-full max-w-2xl")
            .style(f"aspect-ratio: {WIDTH} / {HEIGHT}; touch-action: manipulation"),
            "draw",
        )
        labelled(self.frame, "aria-label", "Reference over time; its points are in the table below")
        with ui.row().classes("items-end gap-2"):
            self.duration = ui.number("Duration [s]", value=self.usual, min=0.1).classes("w-24")
            self.duration.on_value_change(self.draw)
            self.snap = named(ui.switch("Snap", value=True), "snap")
            self.snap.on_value_change(self.draw)
            named(ui.button("Undo", on_click=self.undo).props("outline dense"), "undo-point")
            named(ui.button("Clear", on_click=self.clear).props("outline dense"), "clear-points")
        ui.label("Ready-made motions").classes("text-sm mt-2")
        with ui.row().classes("items-end gap-2"):
            self.first = ui.number("From", format="%.5g").classes("w-20")
            self.other = ui.number("To", format="%.5g").classes("w-20")
            self.cycles = ui.number("Cycles", value=CYCLES, min=1, max=50, precision=0).classes(
                "w-16"
            )
            self.seed = ui.number("Seed", value=0, min=0, precision=0).classes("w-16")
        with ui.row().classes("gap-2"):
            for kind, label in motions.MOTIONS.items():
                button = ui.button(label, on_click=lambda kind=kind: self.ready(kind))
                named(button.props("outline dense"), "wave" if kind == "sine" else f"wave-{kind}")
        if held:
            ui.label("Held while it moves").classes("text-sm mt-2")
        with ui.row().classes("gap-2"):
            self.held = {
                name: ui.number(
                    f"{name} [{self.units.get(name, '')}]",
                    value=round(value, 4),
                    format="%.5g",
                    on_change=self.changed,
                ).classes("w-40")
                for name, value in held.items()
            }
        self.actions = ui.row().classes("w-full mt-2")
        with ui.expansion("Points, as a table", value=False).classes("w-full") as table:
            self.table = ui.column().classes("w-full gap-0 max-h-80 overflow-y-auto flex-nowrap")
        named(table, "points-table")
        with ui.expansion("Points, as text: time and value, one pair a line").classes("w-full"):
            self.text = named(ui.textarea("time value").classes("w-full"), "points")
            self.text.on_value_change(self._typed)
        asked = "or drop a file with the motion over time"
        upload = drop_zone(asked, on_upload=on_event(self._loaded))
        upload.classes("w-full max-w-2xl").props("flat bordered")

    @property
    def told(self) -> dict[str, float]:
        """What a compensator is told beside the reference, as it is held."""
        return {name: float(field.value or 0.0) for name, field in self.held.items()}

    def reaches(self, reach: dict[str, tuple[float, float]]) -> None:
        """Show what can be reached now; ready-made motions go there until one is drawn."""
        self.reach = self.reach | reach
        if self.file is None and not any(self.points.values()):
            self._span()
        self.draw()

    def _span(self) -> None:
        """Fill in ends of ready-made motions, the one at rest first: well within what can be reached."""
        rest, unit = self.rest[self.now], self.channels[self.now].unit
        for field, end in ((self.first, "From"), (self.other, "To")):
            field.set_label(f"{end} [{unit}]")
        first, other = sorted(self.reach[self.now], key=lambda y: abs(y - rest))
        if 0.1 * abs(other - first) < abs(rest - first) and min(first, other) < rest < max(
            first, other
        ):
            first = rest - 0.1 * (other - rest)  # it rests amid what can be reached
        self.first.set_value(float(f"{first + 0.1 * (other - first):.3g}"))
        self.other.set_value(float(f"{first + 0.9 * (other - first):.3g}"))

    @property
    def seconds(self) -> float:
        """Length of the time axis [s]."""
        return max(float(self.duration.value or self.usual), 0.1)

    @property
    def axes(self) -> Axes:
        """Axes of the coordinate at hand."""
        low, high = self.reach[self.now]
        return Axes(self.seconds, low, high, self.channels[self.now].unit, self.now)

    @property
    def grids(self) -> tuple[float, float]:
        """Distances that points snap to: time and value."""
        low, high = self.reach[self.now]
        return motions.grid_of(0.0, self.seconds, SNAPS), motions.grid_of(low, high, SNAPS)

    @property
    def wish(self) -> tuple[object, ...]:
        """What a reference is made of, to tell whether it has changed."""
        points = {name: tuple(own) for name, own in self.points.items()}
        return points, self.file, {name: field.value for name, field in self.held.items()}

    # -- changes ---------------------------------------------------------------------------------

    def _turn(self, name: str) -> None:
        self.now = name
        self._span()
        self.draw()

    def _keep(self) -> None:
        self._changes += 1
        self._before.append(({name: list(own) for name, own in self.points.items()}, self.file))
        del self._before[:-UNDONE]

    def _set(self, points: Points) -> None:
        self._keep()
        self.file = None
        self.points[self.now] = points
        self.draw()

    def undo(self) -> None:
        """Take the last change back."""
        if self._before:
            self._changes += 1
            self.points, self.file = self._before.pop()
            self.draw()

    def clear(self) -> None:
        """Start over, in the coordinate at hand."""
        self._set([])

    def resume(self, other: Sketch) -> None:
        """Go on with what was drawn in another of the same coordinates, over the same time."""
        if set(other.points) == set(self.points):
            self.points, self.file, self._before = other.points, other.file, other._before
            self.duration.set_value(other.duration.value)
            self.draw()

    def ready(self, kind: str) -> None:
        """Put a ready-made motion there."""
        with told():
            if self.first.value is None or self.other.value is None:
                raise DataError("a motion needs its ends", remedy="fill in From and To")
            given = (float(self.first.value), float(self.other.value), int(self.cycles.value or 1))
            self._set(motions.motion(kind, self.seconds, *given, seed=int(self.seed.value or 0)))

    def _mouse(self, event: MouseEventArguments) -> None:
        """Add a point, or move one that is taken hold of."""
        axes, own = self.axes, self.points[self.now]
        if event.type == "mousedown":
            places = [axes.place(*point) for point in own]
            far = [np.hypot(x - event.image_x, y - event.image_y) for x, y in places]
            self._taken = own[int(np.argmin(far))] if far and min(far) <= NEAR else None
            return
        time, value = axes.at(event.image_x, event.image_y)
        if self.snap.value:
            time, value = motions.snapped(time, value, *self.grids)
            time = min(max(time, 0.0), self.seconds)
        else:
            time, value = float(f"{time:.4g}"), float(f"{value:.4g}")
        others = [point for point in own if point != self._taken]
        self._taken = None
        self._set(motions.with_point(others, time, value))

    def _typed(self) -> None:
        """Take points from the text; lines that are none yet are passed over until it is used."""
        if self._quiet:
            return
        try:
            points = motions.parsed(self.text.value or "")
        except DataError:
            return
        self._keep()
        self.file = None
        self.points[self.now] = points
        self.draw(text=False)

    def _edited(self, place: int, time: float | None, value: float | None) -> None:
        own = self.points[self.now]
        if time is None or value is None or place >= len(own) or own[place] == (time, value):
            return
        self._keep()
        self.file = None
        self.points[self.now] = changed = [
            *own[:place],
            (float(time), float(value)),
            *own[place + 1 :],
        ]
        in_order = changed == sorted(changed)
        self.points[self.now] = sorted(changed)
        self.draw(table=not in_order)

    def _removed(self, place: int) -> None:
        own = self.points[self.now]
        self._set([*own[:place], *own[place + 1 :]])

    def _more(self) -> None:
        own = self.points[self.now]
        low, high = self.reach[self.now]
        every, _ = self.grids
        last = own[-1] if own else (-every, 0.5 * (low + high))
        self._set([*own, (round(last[0] + every, 9), float(f"{last[1]:.5g}"))])

    async def _loaded(self, event: UploadEventArguments) -> None:
        self._changes = change = self._changes + 1
        path = await kept(self.desk, event.file)
        found = await asyncio.to_thread(read_upload, path)
        if change != self._changes or self.duration.is_deleted:
            what = "another motion was wished for while it was read"
            raise DataError(what, file=path, remedy="drop it again")
        given = motions.of_file(path, found, self.units, self.channels, self.held)
        self.take(given)

    def take(self, given: Recording) -> None:
        """Take a whole motion in place of what is drawn."""
        self._keep()
        self.file = given
        self.duration.set_value(float(f"{given.duration or self.usual:.5g}"))
        self.draw()

    # -- what it shows and gives -----------------------------------------------------------------

    def reference(self, step: float) -> Recording:
        """Return the reference as a recording.

        Raises
        ------
        DataError
            If it is none yet.
        """
        held = self.told
        if self.file is not None:
            rest = {n: np.full(len(self.file), v) for n, v in held.items() if n not in self.file}
            units = {name: self.units[name] for name in rest}
            return self.file.with_channels(units, **rest) if rest else self.file
        if len(self.channels) == 1:  # what is typed and wrong is told now
            motions.parsed(self.text.value or "")
        drawn = {name: own for name, own in self.points.items() if own} or self.points
        for name in self.points.keys() - drawn.keys():
            held[name] = round(0.5 * sum(self.reach[name]), 3)
            ui.notify(
                f"{name} stays at {held[name]:g} {self.units[name]}: nothing is drawn for it."
            )
        return motions.reference_recording(drawn, step, held, self.units)

    def draw(self, *, text: bool = True, table: bool = True) -> None:
        """Show the points at hand."""
        own, unit = self.points[self.now], self.channels[self.now].unit
        every, grid = self.grids
        snaps = f" Points snap to {every:g} s and {grid:g} {unit}." if self.snap.value else ""
        self.hint.set_text(
            f"From the file {self.file.name}; Clear to draw."
            if self.file is not None
            else f"Click to add points, drag to move them.{snaps}"
        )
        palette = plots.colours(self.desk.dark)
        others = [points for name, points in self.points.items() if name != self.now]
        if self.file is not None:
            shown = motions.thinned(self.file.time - self.file.time[0], self.file[self.now])
            content = self.axes.drawn(shown, [], palette, dots=False)
        else:
            content = self.axes.drawn(own, others, palette)
        self.frame.set_content(content)
        if text:
            self._quiet = True
            self.text.set_value(motions.unparsed(own))
            self._quiet = False
        if table:
            self._tabulate()
        self.changed()

    def _tabulate(self) -> None:
        own, unit = self.points[self.now], self.channels[self.now].unit
        self.table.clear()
        with self.table:
            for place, (time, value) in enumerate(own[:ROWS]):
                with ui.row().classes("items-center gap-2 no-wrap"):
                    fields = [
                        ui.number(value=number, format="%.6g")
                        .props(f'dense suffix="{mark}"')
                        .classes("w-28")
                        for number, mark in ((time, "s"), (value, unit))
                    ]
                    for field, said in zip(fields, ("time", self.now), strict=True):
                        labelled(field, "aria-label", f"{said} of point {place + 1}")
                        for event in ("blur", "keydown.enter"):
                            field.on(
                                event,
                                lambda place=place, fields=fields: self._edited(
                                    place, fields[0].value, fields[1].value
                                ),
                            )
                    away = ui.button(
                        icon="close", on_click=lambda place=place: self._removed(place)
                    )
                    labelled(away.props("flat dense"), "aria-label", f"Remove point {place + 1}")
            if len(own) > ROWS:
                ui.label(f"{len(own) - ROWS} more are in the text below.").classes("text-xs")
            named(ui.button("Add a point", on_click=self._more).props("flat dense"), "add-point")
