"""The fields that say what a file's columns are, and what was held and stands in none."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import Any

from nicegui import ui

from mckibben.app.desk import labelled, named
from mckibben.app.kept import Reading
from mckibben.errors import DataError
from mckibben.files.choosing import Seen
from mckibben.recording import STANDARD_UNITS

LEFT_OUT = "(left out)"


class ReadingFields:
    """Fields for each column of a file, and for constants.

    Parameters
    ----------
    found : sequence of Seen
        The columns as they are read now.
    reading : Reading
        How the file is read now.
    """

    def __init__(self, found: Sequence[Seen], reading: Reading) -> None:
        self._found = found
        self._lines = [_column(place, column, reading) for place, column in enumerate(found)]
        self._held: list[dict[str, Any]] = []
        self._places = count()
        self._constants = ui.column().classes("w-full gap-2")
        for channel, (value, unit) in reading.constants.items():
            self._add(channel, value, unit)
        button = ui.button("Add a constant", icon="add", on_click=lambda: self._add())
        named(button.props("flat dense no-caps"), "add-constant")

    def _add(self, channel: str = "force", value: float | None = None, unit: str = "N") -> None:
        """Show the fields of a constant; one without a value is none."""
        place = next(self._places)
        with self._constants, ui.row().classes("items-center w-full gap-2") as row:
            ui.label("Held, in no column").classes("w-44 font-medium")
            fields = {
                "channel": _channel(channel, list(dict.fromkeys([*STANDARD_UNITS, channel]))),
                "value": ui.number("Value", value=value).classes("w-20"),
                "unit": ui.input("Unit", value=unit).classes("w-20"),
            }
            ui.label("g and kg are weights that hang there").classes("text-xs opacity-70")
            remove = ui.button(icon="delete", on_click=lambda: self._remove(row, fields))
            named(remove.props("flat dense"), f"constant-remove-{place}")
            labelled(remove, "aria-label", "Take this constant out")
        for word, element in fields.items():
            named(element, f"constant-{word}-{place}")
            element.props["aria-label"] = f"{word} of a constant"
        self._held.append(fields)

    def _remove(self, row: ui.row, fields: dict[str, Any]) -> None:
        self._held = [each for each in self._held if each is not fields]
        row.delete()

    def reading(self, rate: float | None, gaps: Any, *, raw: bool, explicit: bool) -> Reading:
        """Return what the fields say; what goes without saying is left unsaid.

        Parameters
        ----------
        rate : float, optional
        gaps : str
        raw : bool
            Whether codes for missing samples are numbers.
        explicit : bool
            Whether to map columns that are found without it, too.

        Raises
        ------
        DataError
            If two are one channel, or no column is left.
        """
        mapped: dict[str, str] = {}
        units: dict[str, str] = {}
        calibration: dict[str, tuple[float, float]] = {}
        kept: list[str] = []
        dropped = False
        constants = self._said_constants()
        for column, line in zip(self._found, self._lines, strict=True):
            channel = str(line["channel"].value or LEFT_OUT).strip()
            if channel == LEFT_OUT:
                dropped = dropped or column.unasked not in ("", "time", *constants)
                if column.unasked == "time":  # or it would be found again
                    mapped["unused_time"], dropped = column.header, True
                continue
            if channel in kept or channel in constants:
                other = "a constant" if channel in constants else "another column"
                raise DataError(
                    f"{column.header:.60} and {other} are to be {channel}",
                    remedy="leave one out, or name it otherwise",
                )
            kept.append(channel)
            if explicit or channel != column.unasked:
                mapped[channel] = column.header
            if line["unit"].value:
                units[channel] = str(line["unit"].value).strip()
            times = 1.0 if line["gain"].value is None else float(line["gain"].value)
            turned = -times if line["sign"].value else times
            if (way := (turned, float(line["offset"].value or 0.0))) != (1.0, 0.0):
                calibration[channel] = way
        if not (signals := [channel for channel in kept if channel != "time"]):
            raise DataError("no column is left", remedy="say of one at least which channel it is")
        return Reading(
            columns=mapped,
            units=units,
            calibration=calibration,
            constants=constants,
            rate=float(rate) if rate else None,
            gaps=gaps,
            raw=raw,
            channels=[*signals, *constants] if dropped else None,
        )

    def _said_constants(self) -> dict[str, tuple[float, str]]:
        said: dict[str, tuple[float, str]] = {}
        for line in self._held:
            channel = str(line["channel"].value or "").strip()
            if line["value"].value is None or channel in ("", LEFT_OUT):
                continue
            if channel in said:
                raise DataError(f"two constants are to be {channel}", remedy="empty one of them")
            said[channel] = float(line["value"].value), str(line["unit"].value or "").strip()
        return said


def _channel(value: str, options: list[str]) -> Any:
    return ui.select(
        options, value=value, label="Channel", with_input=True, new_value_mode="add-unique"
    ).classes("w-40")


def _column(place: int, column: Seen, reading: Reading) -> dict[str, Any]:
    """Show a column and the fields that say what it is."""
    gain, offset = reading.calibration.get(column.channel, (1.0, 0.0))
    options = [LEFT_OUT, "time", *STANDARD_UNITS]
    if column.channel and column.channel not in options:
        options.append(column.channel)
    about = f"of column {column.header:.60}"
    with ui.row().classes("items-center w-full gap-2 border-b border-gray-500/30 pb-1"):
        with ui.column().classes("gap-0 w-44 min-w-0"):
            ui.label(column.header[:80] or f"column {place + 1}").classes("font-medium break-all")
            with named(ui.row().classes("gap-x-1 gap-y-0 text-xs opacity-70"), f"first-{place}"):
                for text in column.first:  # each on one line, for half a number is another one
                    ui.label(text).classes("max-w-full truncate")
        channel = _channel(column.channel or LEFT_OUT, options)
        unit = (
            ui.input(
                "Unit",
                value=reading.units.get(column.channel, ""),
                placeholder=column.unit or "none",
            )
            .props("stack-label")
            .classes("w-20")
        )
        times = ui.number("Times", value=abs(gain)).classes("w-20")
        plus = ui.number("Plus", value=offset).classes("w-20")
        sign = ui.checkbox("Turn sign", value=gain < 0)
    fields = {"channel": channel, "unit": unit, "gain": times, "offset": plus, "sign": sign}
    for word, element in fields.items():
        named(element, f"{word}-{place}")
        element.props["aria-label"] = f"{word} {about}"
    return fields
