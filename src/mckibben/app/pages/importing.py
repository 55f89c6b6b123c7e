"""How a file is read: what was understood of it, shown beside what can be corrected."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app import widgets
from mckibben.app.steps import TEXT, Reading, columns_in, understand
from mckibben.app.terms import GAPS, said
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.files.choosing import Seen
from mckibben.recording import Recording

CHANNELS = [
    "time",
    "pressure",
    "displacement",
    "force",
    "length",
    "contraction",
    "angle",
    "voltage",
]
"""Channels that are offered; any other name can be typed."""

ENCODINGS = {
    "": "As found",
    **{e: e for e in ("utf-8", "cp1252", "utf-16", "cp932", "gb18030", "cp949")},
}

FIRST_LINES = 8
"""Of a text that are shown."""


@dataclass
class Column:
    """The controls of a column."""

    seen: Seen
    channel: str | None
    unit: str | None
    gain: float | None = 1.0
    offset: float | None = 0.0

    def turn(self) -> None:
        """Turn the sign."""
        self.gain, self.offset = -(self.gain or 1.0), -(self.offset or 0.0)


@dataclass
class Form:
    """What a person says about a file; its fields are bound to controls.

    Parameters
    ----------
    path : Path
    reading : Reading
        How it is read at first.
    """

    path: Path
    reading: Reading
    columns: list[Column] = field(default_factory=list)
    recordings: list[Recording] = field(default_factory=list)
    error: MckibbenError | None = None
    rate: float | None = None
    rest_length: float | None = None
    gaps: str = "error"
    raw: bool = False
    header: float | None = None
    skip: float | None = None
    encoding: str = ""
    held: str = ""

    def __post_init__(self) -> None:
        given = self.reading
        for name in ("rate", "rest_length", "gaps", "raw", "encoding"):
            setattr(self, name, getattr(given, name))
        self.header, self.skip = given.header or None, given.skip or None
        self.held = "; ".join(f"{c} = {v:g} {u}" for c, (v, u) in given.constants.items())

    def look(self) -> bool:
        """Read the file as it is said to be, and return whether its columns are others now."""
        self.error, self.recordings, columns = None, [], None
        try:
            self.reading = self.said()
            self.recordings, columns = understand(self.path, self.reading)
        except MckibbenError as error:
            self.error = error
        if columns is None:
            columns = columns_in(self.path, self.reading)
        same = [one.seen.header for one in self.columns] == [one.header for one in columns]
        if not same or not self.columns:
            self.columns = [self._column(one) for one in columns]
            return True
        return False

    def _column(self, seen: Seen) -> Column:
        channel = seen.channel
        gain, offset = self.reading.calibration.get(channel, (1.0, 0.0))
        return Column(seen, channel, self.reading.units.get(channel, seen.unit), gain, offset)

    def said(self) -> Reading:
        """Return the reading that the controls say.

        Raises
        ------
        DataError
            If they contradict each other.
        """
        named = [one for one in self.columns if one.channel]
        twice = {a.channel for a in named for b in named if a is not b and a.channel == b.channel}
        if twice:
            problem = "two columns are this channel"
            raise DataError(problem, channel=min(map(str, twice)), remedy="clear one of `columns`")
        header, skip = int(self.header or 0), int(self.skip or 0)
        layout: dict[str, Any] = {"header": header, "skip": skip, "encoding": self.encoding}
        before = (self.reading.header, self.reading.skip, self.reading.encoding)
        plain = ("rate", "rest_length", "gaps", "raw")
        general = layout | {name: getattr(self, name) for name in plain}
        if not self.columns:
            given = self.reading.model_dump() | general | {"constants": self._held()}
            return Reading.model_validate(given)
        if tuple(layout.values()) != before:  # other columns: what was said of these is void
            self.columns = []
            return Reading.model_validate(general | {"constants": self._held()})
        left_out = any(not one.channel and one.seen.unasked for one in self.columns)
        return Reading.model_validate(
            general
            | {
                "columns": {
                    one.channel: one.seen.header for one in named if one.channel != one.seen.unasked
                },
                "units": {
                    one.channel: one.unit or ""
                    for one in named
                    if (one.unit or "") != one.seen.unit
                },
                "calibration": {
                    one.channel: (one.gain or 1.0, one.offset or 0.0)
                    for one in named
                    if (one.gain or 1.0, one.offset or 0.0) != (1.0, 0.0)
                },
                "channels": [o.channel for o in named if o.channel != "time"] if left_out else None,
                "constants": self._held(),
            }
        )

    def _held(self) -> dict[str, tuple[float, str]]:
        from mckibben.options import constant

        try:
            parts = [part.replace(" = ", "=").strip() for part in self.held.split(";")]
            return dict(constant(part) for part in parts if part)
        except ValueError:
            problem = f"{self.held!r:.80} is no channel with a value and a unit"
            raise DataError(problem, parameter="constants", remedy="write force = 200 g") from None

    def lines(self) -> list[str]:
        """Return the first lines of a text."""
        if self.path.suffix.casefold() not in TEXT:
            return []
        with self.path.open("rb") as file:
            start = file.read(4096)
        with suppress(LookupError):
            return start.decode(self.encoding or "utf-8", "replace").splitlines()[:FIRST_LINES]
        return []


async def ask(
    path: Path,
    reading: Reading,
    take: Callable[[Reading, bool], Any],
    *,
    others: str,
    verb: str = "Import",
) -> None:
    """Ask how a file is to be read, and call ``take`` with that once it can be.

    Parameters
    ----------
    path : Path
        The raw file.
    reading : Reading
        How it is read now.
    take : callable
        Called with the reading, and whether others are read so, too; its errors are shown.
    others : str
        Which others, for a check box; empty for none.
    verb : str
        On the button.
    """
    form = Form(path, reading)
    one = asyncio.Lock()
    await asyncio.to_thread(form.look)
    with widgets.dialog(f"How is {path.name} read?") as shown:
        mark(shown, "importing")

        async def again() -> None:
            async with one:
                if await asyncio.to_thread(form.look):
                    columns.refresh()
            understood.refresh()
            import_button.set_enabled(form.error is None)

        async def finish() -> None:
            await again()
            if form.error is None:
                found = take(form.reading, all_so.value)
                if found is not None:
                    await found
                shown.close()

        check = widgets.guarded(again)

        @ui.refreshable
        def understood() -> None:
            _understood(form)

        @ui.refreshable
        def columns() -> None:
            _columns(form, check)

        understood()
        columns()
        with widgets.row():
            for label, name in (
                ("Samples per second", "rate"),
                ("Rest length [mm]", "rest_length"),
            ):
                number = ui.number(label).bind_value(form, name).on_value_change(check)
                number.props("dense outlined debounce=600 clearable")
            ui.select(GAPS, label="Gaps").bind_value(form, "gaps").on_value_change(check).props(
                "dense outlined"
            )
            held = ui.input("Held, in no column", placeholder="force = 200 g")
            held.bind_value(form, "held").on_value_change(check).props(
                "dense outlined debounce=600"
            )
            ui.checkbox("Codes and counters as measured").bind_value(form, "raw").on_value_change(
                check
            )
        if lines := form.lines():
            with widgets.details("Lines, header and encoding of the text"):
                _layout(form, lines, check)
        with widgets.row(classes="spread"):
            widgets.button("As found", lambda: _reset(form, again))
            ui.space()
            all_so = mark(ui.checkbox(others, value=bool(others)), "others")
            all_so.set_visibility(bool(others))
            import_button = mark(widgets.primary(verb, finish), "import")
            import_button.set_enabled(form.error is None)


async def _reset(form: Form, again: Callable[[], Any]) -> None:
    form.columns, form.reading = [], Reading()
    form.__post_init__()
    await again()


def _understood(form: Form) -> None:
    """Say what is understood as it stands, or what is wrong with it."""
    if form.error is not None:
        widgets.error_box(form.error)
        return
    with ui.element("div"):
        for one in form.recordings[:3]:
            ui.label(summary(one)).classes("muted")
        if len(form.recordings) > 3:
            ui.label(f"and {len(form.recordings) - 3} more recordings").classes("muted")
        for note in form.recordings[0].notes if form.recordings else ():
            ui.label(said(note)).classes("muted")


def summary(recording: Recording) -> str:
    """Return what a recording is, in a line."""
    time = f"{recording.n_samples:,} samples"
    if recording.sample_time is not None:
        time += f", {recording.duration or 0:.4g} s at {1 / recording.sample_time:.4g} Hz"
    ranges = [
        f"{name} {samples.min():.3g} to {samples.max():.3g} {recording.units[name]}".rstrip()
        for name, samples in recording.channels.items()
    ]
    return f"{time}: {', '.join(ranges)}"


def _columns(form: Form, check: Callable[[], Any]) -> None:
    """Show the columns with controls for what each is read as."""

    def cells(column: Column) -> list[Any]:
        def channel() -> None:
            found = ui.input(placeholder="left out").bind_value(column, "channel")
            found.on_value_change(check).style("min-width: 160px")
            widgets.labelled(found, f"Channel of {column.seen.header}")
            found.props("dense outlined clearable debounce=600 list=channels")

        def unit() -> None:
            found = ui.input().bind_value(column, "unit").on_value_change(check)
            found.props("dense outlined debounce=600 aria-label=Unit").style("width: 80px")

        def calibration() -> None:
            with widgets.row():
                for name in ("gain", "offset"):
                    number = ui.number().bind_value(column, name).on_value_change(check)
                    number.props(f"dense outlined debounce=600 aria-label={name}").style(
                        "width: 88px; min-width: 0"
                    )

                async def turn() -> None:
                    column.turn()
                    await check()

                widgets.icon_button("swap_vert", "Turn the sign", turn)

        first = ", ".join(column.seen.first[:3])
        return [column.seen.header, first, channel, unit, calibration]

    if form.columns:
        with ui.element("datalist").props("id=channels"):
            for name in CHANNELS:
                ui.element("option").props(f"value={name}")
        heads = ["Column", "First values", "Channel", "Unit", "Gain, offset, sign"]
        widgets.table(heads, [cells(one) for one in form.columns])


def _layout(form: Form, lines: list[str], check: Callable[[], Any]) -> None:
    with ui.element("pre").classes("code").style("margin: 0; white-space: pre; overflow-x: auto"):
        for at, line in enumerate(lines, start=1):
            ui.label(f"{at:3d}  {line[:160]}")
    with widgets.row():
        for label, name in (("Header in line", "header"), ("Lines after it left out", "skip")):
            number = ui.number(label, min=0, precision=0).bind_value(form, name)
            number.on_value_change(check).props(
                'dense outlined debounce=600 clearable placeholder="as found"'
            )
        ui.select(ENCODINGS, label="Encoding").bind_value(form, "encoding").on_value_change(
            check
        ).props("dense outlined")
