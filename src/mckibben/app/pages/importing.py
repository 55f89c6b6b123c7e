"""Files in: read as they come, one summary of them all, and a dialog on how each is read."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.events import UploadEventArguments

from mckibben.app import scripts
from mckibben.app.desk import LONGEST, Desk, guarded, kept, named, tell
from mckibben.app.kept import Reading
from mckibben.app.reading import AS_FOUND, Seen, columns, options, read_upload, untold
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import STANDARD_UNITS, Recording

QUIET = 0.4
"""After a file, for which no other may come before all are summed up [s]."""

LISTED = 12
"""Problems that are listed one by one."""

LEFT_OUT = "(left out)"


@dataclass
class _Problem:
    """A file that was not read: why, and where it is kept, if it can be asked how it is read."""

    shown: str
    error: MckibbenError
    held: str = ""


@dataclass
class Intake:
    """Files that are just coming in, and what became of them.

    Parameters
    ----------
    desk : Desk
    place : element
        Where the dialogs go.
    """

    desk: Desk
    place: Any
    coming: int = 0
    seen: int = 0
    read: dict[str, list[Recording]] = field(default_factory=dict)
    problems: list[_Problem] = field(default_factory=list)
    one: asyncio.Lock = field(default_factory=asyncio.Lock)
    said: Any = None

    async def uploaded(self, event: UploadEventArguments) -> None:
        """Keep a file and read it; after the last, say what became of them."""
        self.coming += 1
        self.seen += 1
        shown = event.file.name
        try:
            await self._take(event, shown)
        except MckibbenError as error:
            self.problems.append(_Problem(shown, error))
        except Exception as error:  # what nobody has foreseen must not keep the others waiting
            unforeseen = DataError(f"{type(error).__name__}: {error}", remedy="drop it again")
            self.problems.append(_Problem(shown, unforeseen))
        finally:
            self.coming -= 1
        seen = self.seen
        await asyncio.sleep(QUIET)
        if not self.coming and seen == self.seen:
            await self._sum_up()

    async def _take(self, event: UploadEventArguments, shown: str) -> None:
        path = await kept(self.desk, event.file)
        async with self.one:
            if self.said is not None:
                waiting = f" ({self.coming - 1} more)" if self.coming > 1 else ""
                self.said.set_text(f"Reading {shown:.60}{waiting} …")
            try:
                found = await asyncio.to_thread(add, self.desk, path.name, shown, AS_FOUND)
                self.read.setdefault(shown, []).extend(found)
            except MckibbenError as error:
                self.problems.append(_Problem(shown, error, path.name))

    async def _sum_up(self) -> None:
        desk = self.desk
        read, self.read = self.read, {}
        problems, self.problems = self.problems, []
        self.said.set_text("")
        with self.place:
            if read:
                await asyncio.to_thread(desk.workspace.warm)
                desk.settle_channels()
                desk.changed("recordings", "log")
                self.seen = 0
                tell_of(read)
            self.seen = 0
            if len(problems) == 1 and not read and problems[0].held:
                await ask(desk, self.place, problems[0].held, problems[0].shown, problems[0].error)
            elif len(problems) == 1 and not problems[0].held:
                tell(_about(problems[0]))
            elif problems:
                await _list(desk, self.place, problems)


def add(desk: Desk, held: str, shown: str, reading: Reading) -> list[Recording]:
    """Read an uploaded file and add its recordings."""
    path = desk.workspace.path("uploads", held)
    found = read_upload(path, reading)
    if reading == AS_FOUND and (better := untold(path, found)) != AS_FOUND:
        reading, found = better, read_upload(path, better)
    call = scripts.read_call(str(path), options(reading))
    for part, recording in enumerate(found):
        recording = recording.with_meta(name=recording.name.replace(path.stem, Path(shown).stem, 1))
        desk.workspace.add(
            recording,
            origin=f"file {shown}",
            call=call,
            upload=held,
            part=part,
            reading=reading,
        )
    desk.workspace.log(f"read {shown}", call)
    return found


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


def understood(recording: Recording) -> str:
    """Return what was understood of a file: channels, time, and columns that were left out."""
    said = ", ".join(f"{c} in {recording.units[c] or 'no unit'}" for c in recording.channels)
    said += "; no time column" if recording.sample_time is None else ""
    ignored = recording.meta.get("ignored_columns") or ()
    if ignored:
        said += f"; left out: {', '.join(map(str, ignored))}"
    return said[:LONGEST]


def _about(problem: _Problem) -> str:
    text = str(problem.error)
    return text if problem.shown in text else f"{problem.shown}: {text}"


async def _list(desk: Desk, place: Any, problems: Sequence[_Problem]) -> None:
    """Show all problems in one place; files by whose names they are no recordings in one line."""
    foreign = [each for each in problems if not each.held]
    ours = [each for each in problems if each.held]
    with place, ui.dialog() as dialog, named(ui.card().classes("w-full max-w-3xl"), "not-read"):
        ui.label(f"{len(problems)} file(s) were not read").classes("text-lg")
        if foreign:
            names = ", ".join(each.shown for each in foreign[:LISTED])
            more = f" and {len(foreign) - LISTED} more" if len(foreign) > LISTED else ""
            ui.label(f"{len(foreign)} cannot be recordings: {names}{more}").classes("break-all")
            ui.label(str(foreign[0].error)[:LONGEST]).classes("text-sm opacity-70")
        for each in ours[:LISTED]:
            with ui.row().classes("items-center w-full no-wrap"):
                ui.label(_about(each)[:LONGEST]).classes("flex-1 text-sm break-words min-w-0")

                async def mend(each: _Problem = each) -> None:
                    dialog.close()
                    await ask(desk, place, each.held, each.shown, each.error)

                ui.button("How is it to be read?", on_click=guarded(mend)).props("flat dense")
        if len(ours) > LISTED:
            ui.label(f"and {len(ours) - LISTED} more")
        named(ui.button("Close", on_click=dialog.close).props("flat"), "not-read-close")
    dialog.open()


# -- how a file is read ------------------------------------------------------------------------


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
) -> None:
    """Show what is in a file and what it is taken for, and let that be changed."""
    path = desk.workspace.path("uploads", held)
    try:
        found = await asyncio.to_thread(columns, path, reading)
        plain = await asyncio.to_thread(columns, path, AS_FOUND)
        if not any(column.first for column in found):
            raise DataError("there are no columns in it", remedy="export it again")
    except MckibbenError as damaged:
        if name is None:
            path.unlink(missing_ok=True)  # nobody can be asked how it is to be read
        tell(f"{shown}: {error or damaged}")
        return
    with place, ui.dialog() as dialog, ui.card().classes("w-full max-w-4xl gap-2"):
        title = f"{shown} needs help" if error else f"How {shown} is read"
        ui.label(title[:200]).classes("text-lg break-all")
        problem = named(ui.label(str(error or "")).classes("text-negative break-words"), "problem")
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
                    {
                        "error": "refuse",
                        "split": "split there",
                        "interpolate": "bridge by straight lines",
                    },
                    value=reading.gaps,
                    label="Gaps and blank cells",
                ).classes("w-56"),
                "gaps",
            )
            title_field = None
            if name is not None:
                title_field = named(ui.input("Name", value=name).classes("w-56"), "rename")
        alike = _alike(desk, name)
        others = None
        if alike:
            others = named(
                ui.checkbox(f"Read the {len(alike)} others with the same columns so too"), "alike"
            )

        async def again() -> None:
            try:
                chosen = _chosen(found, plain, lines, rate.value, gaps.value, error is not None)
                if name is None:
                    read = await asyncio.to_thread(add, desk, held, shown, chosen)
                else:
                    which = [name, *(alike if others is not None and others.value else [])]
                    read = await asyncio.to_thread(_replace, desk, which, chosen)
                    if title_field is not None and title_field.value not in ("", name):
                        desk.preview = desk.workspace.rename(name, title_field.value)
            except MckibbenError as wrong:
                problem.set_text(str(wrong)[:LONGEST])
                problem.set_visibility(True)
                return
            dialog.close()
            desk.settle_channels()
            desk.changed("recordings", "channels", "log")
            tell_of({shown: read})

        with ui.row():
            named(ui.button("Read it so", on_click=guarded(again)), "read-again")
            ui.button("Leave it", on_click=dialog.close).props("flat")
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
            ui.label(", ".join(column.first)[:60]).classes("text-xs opacity-70 break-all")
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


def _replace(desk: Desk, names: Sequence[str], reading: Reading) -> list[Recording]:
    """Read the files of recordings otherwise, all or none, and return what came of the first."""
    workspace = desk.workspace
    made = {}
    for name in names:
        upload = workspace.entry(name).upload
        path = workspace.path("uploads", upload)
        made[name] = read_upload(path, reading), scripts.read_call(str(path), options(reading))
    workspace.read_again(made, reading)
    for _, call in made.values():
        workspace.log(f"read {', '.join(names)} again", call)
    return made[names[0]][0]


def _alike(desk: Desk, name: str | None) -> list[str]:
    """Return other recordings with the same channels, of files that are kept."""
    workspace, found = desk.workspace, list[str]()
    if name is None:
        return found
    for entry in workspace.entries():
        known = entry.upload and entry.reading == workspace.entry(name).reading
        if entry.name == name or not known:
            continue
        try:
            same = list(workspace.recording(entry.name).channels)
        except MckibbenError:
            continue
        if same == list(workspace.recording(name).channels):
            found.append(entry.name)
    return found
