"""A dialog on how a file is read, with what was understood of it filled in."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from nicegui import ui

from mckibben.app.adding import Problem, about_gaps, add, alike, replaced, understood
from mckibben.app.desk import LONGEST, Desk, guarded, named, tell
from mckibben.app.fields import GAPS, said
from mckibben.app.kept import Reading
from mckibben.app.reading import AS_FOUND, Seen, columns
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import STANDARD_UNITS, Recording

LEFT_OUT = "(left out)"


async def ask_again(desk: Desk, place: Any, name: str) -> None:
    """Ask how the file of a recording is to be read, with what was understood filled in."""
    entry = desk.workspace.entry(name)
    if not entry.upload:
        raise DataError(
            f"{name} came from {entry.origin}, not from a file that is kept here",
            remedy="drop a file to say how it is read; edits below work for all recordings",
        )
    shown = entry.origin.removeprefix("file ")
    await ask(desk, place, entry.upload, shown, None, entry.reading, name)


async def ask(
    desk: Desk,
    place: Any,
    held: str,
    shown: str,
    error: MckibbenError | None,
    reading: Reading = AS_FOUND,
    name: str | None = None,
    unread: Sequence[Problem] = (),
    then: Callable[[list[Problem]], Awaitable[None]] | None = None,
) -> None:
    """Show what is in a file and what it is taken for, and let that be changed.

    Parameters
    ----------
    desk : Desk
    place : element
        Where the dialog goes.
    held, shown : str
        What the file is called among the uploads, and to a person.
    error : MckibbenError, optional
        Why it was not read.
    reading : Reading
        How it was.
    name : str, optional
        Of the recording, of a file that was read.
    unread : sequence of Problem
        Other files that were not read, which may be read so too.
    then : callable, optional
        Given those that still were not.
    """
    path, left = desk.workspace.path("uploads", held), list(unread)
    try:
        found = await asyncio.to_thread(columns, path, reading)
        plain = await asyncio.to_thread(columns, path, AS_FOUND)
        if not any(column.first for column in found):
            raise DataError("there are no columns in it", remedy="export it again")
    except MckibbenError as damaged:
        if name is None:
            path.unlink(missing_ok=True)  # nobody can be asked how it is to be read
        tell(str(Problem(shown, error or damaged)))
        if then is not None and left:
            await then(left)
        return
    with place, ui.dialog() as dialog, ui.card().classes("w-full max-w-4xl gap-2"):
        title = f"{shown} needs help" if error else f"How {shown} is read"
        ui.label(title[:200]).classes("text-lg break-all")
        words = "" if error is None else said(error)
        problem = named(ui.label(words).classes("text-negative break-words"), "problem")
        problem.set_visibility(error is not None)
        lines = [_column(place_, column, reading) for place_, column in enumerate(found)]
        with ui.row().classes("items-end gap-4"):
            rate = named(
                ui.number("Samples per second", value=reading.rate, min=0)
                .props('hint="without a column of times"')
                .classes("w-56"),
                "rate",
            )
            gaps = named(
                ui.select(
                    GAPS,
                    value="interpolate" if about_gaps(error) else reading.gaps,
                    label="Gaps and blank cells",
                ).classes("w-56"),
                "gaps",
            )
            title_field = None
            if name is not None:
                title_field = named(ui.input("Name", value=name).classes("w-56"), "rename")
        others = [one.shown for one in unread] if name is None else alike(desk, name)
        which = "that were not read" if name is None else "with the same columns"
        so_too = named(
            ui.checkbox(f"Read the {len(others)} others {which} so too", value=name is None),
            "alike",
        )
        so_too.set_visibility(bool(others))
        asked = {"many": False}

        async def read_so(chosen: Reading) -> dict[str, list[Recording]]:
            """Read the file, and others if wished for; keep those that still are not."""
            too = so_too.value and others
            if name is not None:
                names = [name, *(others if too else [])]
                return {shown: await asyncio.to_thread(replaced, desk, names, chosen)}
            many, asked["many"] = asked["many"], True
            read = {shown: await asyncio.to_thread(add, desk, held, shown, chosen, many=many)}
            for one in list(left) if too else []:
                problem.set_text(f"Reading {one.shown:.60} …")
                problem.set_visibility(True)
                try:
                    read[one.shown] = await asyncio.to_thread(
                        add, desk, one.held, one.shown, chosen
                    )
                    left.remove(one)
                except MckibbenError as wrong:
                    one.error = wrong
            return read

        async def again() -> None:
            try:
                chosen = _chosen(found, plain, lines, rate.value, gaps.value, error is not None)
                read = await read_so(chosen)
                if name is not None and title_field and title_field.value not in ("", name):
                    wish = title_field.value
                    desk.preview = await asyncio.to_thread(desk.workspace.rename, name, wish)
                    if desk.preview != wish:
                        ui.notify(
                            f"It is named {desk.preview}: {wish:.80} is taken, or is no name."
                        )
            except MckibbenError as wrong:
                problem.set_text(said(wrong))
                problem.set_visibility(True)
                return
            dialog.close()
            desk.settle_channels()
            desk.changed("recordings", "channels", "log")
            tell_of(read)
            if then is not None:
                await then(left)

        async def leave() -> None:
            dialog.close()
            if then is not None:
                await then([Problem(shown, error, held), *left] if error else left)

        with ui.row():
            named(ui.button("Read it so", on_click=guarded(again)), "read-again")
            ui.button("Leave it", on_click=guarded(leave)).props("flat")
    dialog.open()


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
        channel = ui.select(
            options,
            value=column.channel or LEFT_OUT,
            label="Channel",
            with_input=True,
            new_value_mode="add-unique",
        ).classes("w-40")
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


def _chosen(
    found: Sequence[Seen],
    plain: Sequence[Seen],
    lines: Sequence[dict[str, Any]],
    rate: float | None,
    gaps: Any,
    explicit: bool,
) -> Reading:
    """Return what the fields say; what goes without saying is left unsaid."""
    mapped: dict[str, str] = {}
    units: dict[str, str] = {}
    calibration: dict[str, tuple[float, float]] = {}
    kept: list[str] = []
    dropped = False
    for column, as_found, line in zip(found, plain, lines, strict=True):
        channel = str(line["channel"].value or LEFT_OUT).strip()
        if channel == LEFT_OUT:
            dropped = dropped or as_found.channel not in ("", "time")
            if as_found.channel == "time":  # or it would be found again
                mapped["unused_time"], dropped = column.header, True
            continue
        if channel in kept:
            raise DataError(
                f"two columns are to be {channel}", remedy="leave one out, or name it otherwise"
            )
        kept.append(channel)
        if explicit or channel != as_found.channel:
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
        rate=float(rate) if rate else None,
        gaps=gaps,
        channels=signals if dropped else None,
    )


def tell_of(read: dict[str, list[Recording]]) -> None:
    """Say what was understood of files, all at once."""
    recordings = [one for several in read.values() for one in several]
    if len(read) == 1:
        (shown,) = read
        said = f"{shown}: " + "; ".join(
            dict.fromkeys(f"{len(one)} samples, {understood(one)}" for one in recordings)
        )
    else:
        said = f"{len(read)} files: {len(recordings)} recording(s)."
        timeless = sum(one.sample_time is None for one in recordings)
        if timeless:
            said += f" {timeless} without time."
        noted = sum(bool(one.notes) for one in recordings)
        if noted:
            said += f" Something was assumed or mended in {noted} of them: see their lines."
    ui.notify(said[:LONGEST], multi_line=True, timeout=8000, type="info")
