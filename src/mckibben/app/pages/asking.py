"""A dialog on how a file is read, with what was understood of it filled in."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app.adding import Problem, add, alike, replaced, source, understood
from mckibben.app.desk import LONGEST, Desk, guarded, named, tell
from mckibben.app.fields import GAPS, RAW, said
from mckibben.app.kept import Reading
from mckibben.app.pages.columns import ReadingFields
from mckibben.app.reading import AS_FOUND, columns
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import Recording


async def ask_again(desk: Desk, place: Any, name: str) -> None:
    """Ask how the file of a recording is to be read, with what was understood filled in."""
    entry = desk.workspace.entry(name)
    shown = entry.origin.removeprefix("file ") if entry.upload else name
    await ask(desk, place, source(desk.workspace, entry), shown, None, entry.reading, name)


async def ask(
    desk: Desk,
    place: Any,
    path: Path,
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
    path : Path
        The file.
    shown : str
        What it is called to a person.
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
    left = list(unread)
    try:
        found = await asyncio.to_thread(columns, path, reading)
        if not any(column.first for column in found):
            raise DataError("there are no columns in it", remedy="export it again")
    except MckibbenError as damaged:
        if name is None:
            path.unlink(missing_ok=True)  # nobody can be asked how it is to be read
        tell(str(Problem(shown, error or damaged)))
        if then is not None:
            await then(left)
        return
    with place, ui.dialog() as dialog, ui.card().classes("w-full max-w-4xl gap-2"):
        title = f"{shown} needs help" if error else f"How {shown} is read"
        ui.label(title[:200]).classes("text-lg break-all")
        words = "" if error is None else said(error)
        problem = named(ui.label(words).classes("text-negative break-words"), "problem")
        problem.set_visibility(error is not None)
        fields = ReadingFields(found, reading)
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
                    value=reading.gaps,
                    label="Gaps and blank cells",
                ).classes("w-56"),
                "gaps",
            )
            raw = named(ui.checkbox(RAW, value=reading.raw), "raw")
            title_field = None
            if name is not None:
                title_field = named(ui.input("Name", value=name).classes("w-56"), "rename")
        others = [one.shown for one in unread] if name is None else alike(desk, name)
        which = "that were not read" if name is None else "with the same columns"
        so_too = named(
            ui.checkbox(
                f"Read the {len(others)} others {which} so too"
                if len(others) > 1
                else f"Read the other one {which.replace('were', 'was')} so too",
                value=name is None,
            ),
            "alike",
        )
        constants_too = named(
            ui.checkbox("with the same constants: the same load hung there", value=False),
            "alike-constants",
        )
        so_too.set_visibility(bool(others))
        constants_too.set_visibility(bool(others))
        asked = {"many": False}

        def way(chosen: Reading, other: str = "") -> Reading:
            """Return how another file is read so too: a load is its own, unless it is said to be one."""
            if constants_too.value:
                return chosen
            own = desk.workspace.entry(other).reading.constants if other else {}
            channels = chosen.channels and [
                *(channel for channel in chosen.channels if channel not in chosen.constants),
                *own,
            ]
            return chosen.model_copy(update={"constants": own, "channels": channels})

        async def read_so(chosen: Reading) -> dict[str, list[Recording]]:
            """Read the file, and others if wished for; keep those that still are not."""
            too = so_too.value and others
            if name is not None:
                ways = {other: way(chosen, other) for other in (others if too else ())}
                same = [name, *(other for other, its in ways.items() if its == chosen)]
                found = await asyncio.to_thread(replaced, desk, same, chosen)
                for other in sorted(ways.keys() - same):
                    await asyncio.to_thread(replaced, desk, [other], ways[other])
                return {shown: found}
            theirs = way(chosen)
            many, asked["many"] = asked["many"], True
            read = {shown: await asyncio.to_thread(add, desk, path.name, shown, chosen, many=many)}
            for one in list(left) if too else []:
                problem.set_text(f"Reading {one.shown:.60} …")
                problem.set_visibility(True)
                try:
                    read[one.shown] = await asyncio.to_thread(
                        add, desk, one.held, one.shown, theirs
                    )
                    left.remove(one)
                except MckibbenError as wrong:
                    one.error = wrong
            return read

        async def again() -> None:
            try:
                chosen = fields.reading(
                    rate.value, gaps.value, raw=bool(raw.value), explicit=error is not None
                )
                same = name is not None and chosen == reading and not so_too.value
                read = {} if same else await read_so(chosen)
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
            if read:
                tell_of(read)
            if then is not None:
                await then(left)

        async def leave() -> None:
            dialog.close()
            if then is not None:
                await then([Problem(shown, error, path.name), *left] if error else left)

        with ui.row():
            named(
                ui.button("Read it so", on_click=guarded(again, f"Reading {shown:.40}")),
                "read-again",
            )
            ui.button("Leave it", on_click=guarded(leave)).props("flat")
    dialog.open()


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
