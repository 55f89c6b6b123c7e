"""How a file is read: what was understood of it, shown beside what can be corrected."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import forms, widgets
from mckibben.app.steps import UNTOUCHED, Reading, understand
from mckibben.app.terms import choice, message_of
from mckibben.app.widgets import mark
from mckibben.channels import by_name
from mckibben.errors import DataError, MckibbenError
from mckibben.files.choosing import Seen
from mckibben.files.formats import READERS
from mckibben.files.reading import columns_of
from mckibben.files.xlsx import sheets
from mckibben.recording import Recording

CHANNELS = (
    *("time", "pressure", "displacement", "force", "length", "contraction", "angle"),
    "voltage",
)
"""Channels that are offered; any other name can be typed."""

ENCODINGS = ("utf-8", "cp1252", "utf-16", "cp932", "gb18030", "cp949")
"""Encodings that are offered."""

FIRST_LINES = 8
"""Lines of a text that are shown."""

LAYOUT = ("header", "skip", "encoding", "sheet")
"""Options that the columns of a file depend on."""

SAMPLES = ("rate", "sample_time", "rest_length", "constants", "gaps", "join", "raw")
"""What else is chosen for a whole file; columns, units and calibrations are controls of the columns."""

COLUMN_OPTIONS = ("columns", "units", "calibration", "channels")
"""Options that the controls of the columns state."""

FIELD_PROPS = "dense outlined debounce=600"


@dataclass
class Column:
    """The controls of a column."""

    seen: Seen
    channel: str | None
    unit: str | None
    gain: float | None = 1.0
    offset: float | None = 0.0

    @property
    def line(self) -> tuple[float, float]:
        """Gain and offset."""
        return self.gain or 1.0, self.offset or 0.0


@dataclass
class Form:
    """What a person says about a file; its columns and values are bound to controls."""

    path: Path
    reading: Reading
    columns: list[Column] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    recordings: list[Recording] = field(default_factory=list)
    error: MckibbenError | None = None

    def __post_init__(self) -> None:
        self.start(self.reading)

    def start(self, reading: Reading) -> None:
        """Begin with a reading."""
        self.reading, self.columns = reading, []
        self.values |= {name: getattr(reading, name) for name in (*SAMPLES, *LAYOUT)}
        each = reading.constants.items()
        self.values["constants"] = "; ".join(f"{name}={v:g} {unit}" for name, (v, unit) in each)

    def look(self) -> bool:
        """Read the file as the controls say, and return whether its columns are others now."""
        columns: list[Seen] = []
        self.error, self.recordings = None, []
        try:
            self.reading = self.stated()
            self.recordings, columns = understand(self.path, self.reading)
        except MckibbenError as error:
            self.error = error
            with suppress(DataError):
                columns = columns_of(self.path, self.reading)
        if self.columns and [c.seen.header for c in self.columns] == [c.header for c in columns]:
            return False
        self.columns = [self._column(seen) for seen in columns]
        return True

    def _column(self, seen: Seen) -> Column:
        """Return the controls of a column, as the reading states it."""
        name, reading = seen.channel, self.reading
        unit = reading.units.get(name, seen.unit)
        used = reading.channels is None or name in ("time", *reading.channels)
        return Column(seen, name if used else "", unit, *reading.lines.get(name, (1.0, 0.0)))

    def stated(self) -> Reading:
        """Return the reading that the controls state; `DataError` if they contradict each other."""
        plain = replace(UNTOUCHED, **forms.given(Reading, self.values))
        if any(getattr(plain, name) != getattr(self.reading, name) for name in LAYOUT):
            self.columns = []  # others: what was stated of these is void
            return plain
        if not self.columns:
            named = {name: getattr(self.reading, name) for name in COLUMN_OPTIONS}
            return replace(plain, **named)
        used = [(one.channel, one) for one in self.columns if one.channel]
        channel, count = Counter(name for name, _ in used).most_common(1)[0] if used else ("", 0)
        if count > 1:
            problem = "two columns are this channel"
            raise DataError(problem, channel=channel, remedy="clear one of `columns`")
        left_out = any(one.seen.unasked and not one.channel for one in self.columns)
        # a unit that a remedy stated is stated from then on, also if it is that of the file
        kept = self.reading.units
        return replace(
            plain,
            columns={n: one.seen.header for n, one in used if n != one.seen.unasked},
            units={
                n: one.unit or ""
                for n, one in used
                if (one.unit or "") != one.seen.unit or n in kept
            },
            calibration={n: one.line for n, one in used if one.line != (1.0, 0.0)},
            channels=[n for n, _ in used if n != "time"] if left_out else None,
        )

    def layout(self) -> tuple[list[str], dict[str, list[str]]]:
        """Return the fields of the layout that the file has, and what can be chosen in them."""
        reader = READERS.get(self.path.suffix.casefold(), "text")
        if reader == "xlsx":
            return ["sheet"], {"sheet": sheets(self.path)}
        return ["header", "skip", "encoding"] * (reader == "text"), {"encoding": [*ENCODINGS]}

    def lines(self) -> list[str]:
        """Return the first lines of a text."""
        if READERS.get(self.path.suffix.casefold(), "text") != "text":
            return []
        with self.path.open("rb") as file:
            start = file.read(4096)
        with suppress(LookupError):
            text = start.decode(self.reading.encoding or "utf-8", "replace")
            return text.splitlines()[:FIRST_LINES]
        return []


async def ask(
    path: Path,
    reading: Reading,
    take: Callable[[Reading, bool], Any],
    *,
    others: str,
    verb: str = "Import",
    ticked: bool = True,
) -> None:
    """Ask how a file is to be read, now as ``reading`` states, and ``take`` that once it can be.

    That is a coroutine function, called also with whether ``others`` (empty for none) are read so, too.
    """
    form = Form(path, reading)
    await asyncio.to_thread(form.look)
    with widgets.dialog(f"Import settings of {path.name}") as window:
        mark(window, "importing")
        settings = _Settings(form)
        settings.show()
        with widgets.row(classes="spread"):
            widgets.button("As found", partial(settings.read_as, UNTOUCHED))
            ui.space()
            tick = mark(ui.checkbox(others, value=bool(others) and ticked), "others")
            tick.set_visibility(bool(others))

            async def finish() -> None:
                await settings.read_again()
                if form.error is None:
                    await take(form.reading, tick.value)
                    window.close()

            settings.button = mark(widgets.primary(verb, finish), "import")
            settings.button.set_enabled(form.error is None)


class _Settings:
    """The controls of a form and what they make of its file, which is read again at each change."""

    def __init__(self, form: Form) -> None:
        self.form = form
        self.button: Any = None
        self._reading = asyncio.Lock()
        self._check = widgets.guarded(self.read_again)
        self._result, self._columns = ui.refreshable(_understood), ui.refreshable(_columns)
        self._controls = ui.refreshable(self._show_controls)

    def show(self) -> None:
        """Build all three parts: what was read, its columns, and the settings of the whole file."""
        self._result(self.form, self.read_as)
        self._columns(self.form, self._check)
        self._controls()

    async def read_again(self) -> None:
        """Read the file as the controls say, and show what comes of it."""
        async with self._reading:
            if await asyncio.to_thread(self.form.look):
                self._columns.refresh()
        self._result.refresh()
        if self.button is not None:
            self.button.set_enabled(self.form.error is None)

    async def read_as(self, reading: Reading) -> None:
        """Begin again with other settings."""
        self.form.start(reading)
        self._controls.refresh()
        await self.read_again()
        self._columns.refresh()

    def _show_controls(self) -> None:
        self._fields(SAMPLES)
        names, choices = self.form.layout()
        if not names:
            return
        title = "Sheet" if names == ["sheet"] else "Lines and encoding of the text"
        with widgets.details(title):
            numbered = [
                [str(row), line[:160]] for row, line in enumerate(self.form.lines(), start=1)
            ]
            if numbered:
                widgets.table(["", "First lines"], numbered)
            self._fields(names, choices)

    def _fields(
        self, names: Iterable[str], choices: Mapping[str, Iterable[str]] = forms.NO_CHOICES
    ) -> None:
        with ui.element("div").classes("fields"):
            forms.fields(Reading, names, self.form.values, choices=choices, changed=self._check)


def _understood(form: Form, read_as: Callable[[Reading], Any]) -> None:
    """Show what was read, or what is wrong, with the options that read it as buttons."""
    if form.error is not None:
        problem = copy(form.error)
        problem.options = ()  # these are buttons
        widgets.error_box(problem)
        with widgets.row():
            for options in form.error.options:
                act = partial(read_as, form.reading.changed(options))
                mark(widgets.button(choice(options), act, "auto_fix_high"), "remedy")
        return
    found = form.recordings
    if not found:  # it is being read
        return
    more = [f"and {len(found) - 3} more recordings"] * (len(found) > 3)
    with ui.element("div"):
        for text in [*map(summary, found[:3]), *more, *map(message_of, found[0].notes)]:
            ui.label(text).classes("muted")
    inputs, outputs = by_name(found[:1])
    if inputs and outputs:
        ui.label("Inputs and outputs, each over its own range").classes("muted")
        widgets.overlay({name: found[0][name] for name in (*inputs, *outputs)})


def summary(recording: Recording) -> str:
    """Return samples, duration, rate and ranges of a recording in a line."""
    time = f"{recording.n_samples} samples"
    if recording.sample_time is not None:
        time += f", {recording.duration or 0:.4g} s at {1 / recording.sample_time:.4g} Hz"
    ranges = [
        f"{name} {samples.min():.3g} to {samples.max():.3g} {recording.units[name]}".rstrip()
        for name, samples in recording.channels.items()
    ]
    return f"{time}: {', '.join(ranges)}"


def _columns(form: Form, check: Callable[[], Any]) -> None:
    """Show the columns with controls for what each is read as."""
    sampled = form.recordings[0].meta.get("sampled", {}) if form.recordings else {}

    def cells(column: Column) -> list[Any]:
        def bound(made: Any, name: str, label: str, width: int) -> None:
            made.bind_value(column, name).on_value_change(check).props(FIELD_PROPS)
            widgets.labelled(made, label).style(f"width: {width}px; min-width: 0")

        def channel() -> None:
            made = ui.input(placeholder="left out").props("clearable list=channels")
            bound(made, "channel", f"Channel of {column.seen.header}", 180)

        def calibration() -> None:
            async def turn() -> None:
                column.gain, column.offset = (-one for one in column.line)
                await check()

            with widgets.row():
                for name in ("gain", "offset"):
                    bound(ui.number(), name, name, 88)
                widgets.icon_button("swap_vert", "Turn the sign", turn)

        def unit() -> None:
            bound(ui.input(), "unit", "Unit", 80)

        def values() -> None:
            ui.label(", ".join(column.seen.first[:3])).classes("muted")
            numbers = column.seen.numbers
            if numbers is not None and np.isfinite(numbers).any():
                widgets.overlay({"": numbers})
                text = f"{np.nanmin(numbers):.4g} to {np.nanmax(numbers):.4g}"
                if rate := sampled.get(column.channel):
                    text += f", at {rate:.3g} Hz"
                ui.label(text).classes("muted")

        return [column.seen.header, values, channel, unit, calibration]

    if form.columns:
        with ui.element("datalist").props("id=channels"):
            for name in CHANNELS:
                ui.element("option").props(f"value={name}")
        heads = ["Column", "Values", "Channel", "Unit", "Gain, offset, sign"]
        widgets.table(heads, [cells(one) for one in form.columns])
