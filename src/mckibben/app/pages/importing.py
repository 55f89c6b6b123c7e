"""How a file is read: what was understood of it, shown beside what can be corrected."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app import widgets
from mckibben.app.steps import Reading, understand
from mckibben.app.terms import GAPS, message_of
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.files.choosing import Seen
from mckibben.files.formats import READERS
from mckibben.files.reading import columns_of
from mckibben.parsers import constant
from mckibben.recording import Recording

CHANNELS = (
    *("time", "pressure", "displacement", "force", "length", "contraction", "angle"),
    "voltage",
)
"""Channels that are offered; any other name can be typed."""

KNOWN = ("utf-8", "cp1252", "utf-16", "cp932", "gb18030", "cp949")
ENCODINGS: dict[str | None, str] = {None: "As found", **{name: name for name in KNOWN}}

FIRST_LINES = 8
"""Of a text that are shown."""

LAYOUT = ("header", "skip", "encoding")
"""What the columns depend on."""

FIELD = "dense outlined debounce=600"


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
        self.values |= {name: getattr(reading, name) for name in ("rest_length", "gaps", "raw")}
        self.values |= {name: getattr(reading, name) or None for name in ("rate", *LAYOUT)}
        each = reading.constants.items()
        self.values["held"] = "; ".join(f"{name} = {v:g} {unit}" for name, (v, unit) in each)

    def look(self) -> bool:
        """Read the file as it is said to be, and return whether its columns are others now."""
        columns: list[Seen] = []
        self.error, self.recordings = None, []
        try:
            self.reading = self.message_of()
            self.recordings, columns = understand(self.path, self.reading)
        except MckibbenError as error:
            self.error = error
            with suppress(DataError):
                columns = columns_of(self.path, self.reading.read_options())
        if self.columns and [c.seen.header for c in self.columns] == [c.header for c in columns]:
            return False
        units, lines = self.reading.units, self.reading.calibration
        self.columns = [
            Column(one, of, units.get(of, one.unit), *lines.get(of, (1.0, 0.0)))
            for one, of in ((one, one.channel) for one in columns)
        ]
        return True

    def message_of(self) -> Reading:
        """Return the reading that the controls say; `DataError` if they contradict each other."""
        general = {name: self.values[name] for name in ("rate", "rest_length", "gaps", "raw")}
        general |= {name: int(self.values[name] or 0) for name in ("header", "skip")}
        general["encoding"] = self.values["encoding"]
        held = [part.replace(" = ", "=").strip() for part in self.values["held"].split(";")]
        try:
            general["constants"] = dict(constant(part) for part in held if part)
        except ValueError:
            problem = f"{self.values['held']!r:.80} is no channel with a value and a unit"
            raise DataError(problem, parameter="constants", remedy="write force = 200 g") from None
        if any(general[name] != getattr(self.reading, name) for name in LAYOUT):
            self.columns = []  # others: what was said of these is void
            return Reading(**general)
        if not self.columns:
            return self.reading.model_copy(update=general)
        used = [(one.channel, one) for one in self.columns if one.channel]
        channel, count = Counter(name for name, _ in used).most_common(1)[0] if used else ("", 0)
        if count > 1:
            problem = "two columns are this channel"
            raise DataError(problem, channel=channel, remedy="clear one of `columns`")
        left_out = any(one.seen.unasked and not one.channel for one in self.columns)
        return Reading(
            **general,
            columns={n: one.seen.header for n, one in used if n != one.seen.unasked},
            units={n: one.unit or "" for n, one in used if (one.unit or "") != one.seen.unit},
            calibration={n: one.line for n, one in used if one.line != (1.0, 0.0)},
            channels=[n for n, _ in used if n != "time"] if left_out else None,
        )

    def lines(self) -> list[str]:
        """Return the first lines of a text."""
        if READERS.get(self.path.suffix.casefold()) != "text":
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
    """Ask how a file is to be read, now as ``reading`` says, and ``take`` that once it can be.

    That is a coroutine function, called also with whether ``others`` (empty for none) are read so, too.
    """
    form, one = Form(path, reading), asyncio.Lock()
    await asyncio.to_thread(form.look)

    async def again() -> None:
        async with one:
            if await asyncio.to_thread(form.look):
                columns.refresh()
        understood.refresh()
        button.set_enabled(form.error is None)

    async def finish() -> None:
        await again()
        if form.error is None:
            await take(form.reading, all_so.value)
            shown.close()

    async def as_found() -> None:
        form.start(Reading())
        await again()

    check = widgets.guarded(again)

    def bound(made: Any, name: str) -> None:
        made.bind_value(form.values, name).on_value_change(check).props(FIELD)

    understood, columns = ui.refreshable(_understood), ui.refreshable(_columns)
    with widgets.dialog(f"Import settings of {path.name}") as shown:
        mark(shown, "importing")
        understood(form)
        columns(form, check)
        with widgets.row():
            bound(ui.number("Samples per second").props("clearable"), "rate")
            bound(ui.number("Rest length [mm]").props("clearable"), "rest_length")
            bound(ui.select(GAPS, label="Gaps"), "gaps")
            held = ui.input("Held, such as force = 200 g")
            bound(held.tooltip("A constant channel that has no column"), "held")
            bound(ui.checkbox("Codes and counters as measured"), "raw")
        if lines := form.lines():
            with widgets.details("Lines, header and encoding of the text"):
                numbered = [[str(at), line[:160]] for at, line in enumerate(lines, start=1)]
                widgets.table(["", "First lines"], numbered)
                with widgets.row():
                    labels = {"header": "Header in line", "skip": "Lines after it left out"}
                    for name, label in labels.items():
                        number = ui.number(label, min=0, precision=0, placeholder="as found")
                        bound(number.props("clearable"), name)
                    bound(ui.select(ENCODINGS, label="Encoding"), "encoding")
        with widgets.row(classes="spread"):
            widgets.button("As found", as_found)
            ui.space()
            all_so = mark(ui.checkbox(others, value=bool(others) and ticked), "others")
            all_so.set_visibility(bool(others))
            button = mark(widgets.primary(verb, finish), "import")
            button.set_enabled(form.error is None)


def _understood(form: Form) -> None:
    """Say what is understood as it stands, or what is wrong with it."""
    if form.error is not None:
        widgets.error_box(form.error)
        return
    found = form.recordings
    more = [f"and {len(found) - 3} more recordings"] * (len(found) > 3)
    with ui.element("div"):
        for text in [*map(summary, found[:3]), *more, *map(message_of, found[0].notes)]:
            ui.label(text).classes("muted")


def summary(recording: Recording) -> str:
    """Return what a recording is, in a line."""
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

    def cells(column: Column) -> list[Any]:
        def bound(made: Any, name: str, label: str, width: int) -> None:
            made.bind_value(column, name).on_value_change(check).props(FIELD)
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

        return [column.seen.header, ", ".join(column.seen.first[:3]), channel, unit, calibration]

    if form.columns:
        with ui.element("datalist").props("id=channels"):
            for name in CHANNELS:
                ui.element("option").props(f"value={name}")
        heads = ["Column", "First values", "Channel", "Unit", "Gain, offset, sign"]
        widgets.table(heads, [cells(one) for one in form.columns])
