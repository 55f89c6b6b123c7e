"""Files in: read as they come, and one summary of them all, with those that were not."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.events import UploadEventArguments

from mckibben.app.adding import Problem, add
from mckibben.app.busy import doing
from mckibben.app.desk import Desk, guarded, kept, named, tell, told
from mckibben.app.fields import said
from mckibben.app.pages.asking import ask, tell_of
from mckibben.app.reading import AS_FOUND
from mckibben.app.recordings import unescaped
from mckibben.errors import DataError, MckibbenError, TooLargeError
from mckibben.recording import Recording

LISTED = 12
"""Problems that are listed one by one."""


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
    told: int = 0
    sending: bool = False
    read: dict[str, list[Recording]] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    one: asyncio.Lock = field(default_factory=asyncio.Lock)
    left: list[Problem] = field(default_factory=list)
    reading: Any = None
    pending: Any = None

    def watch(self, upload: Any) -> None:
        """Take the files of an uploader, which tells when all are here."""
        upload.on_upload(self.uploaded)
        upload.on("finish", self._sent)

    async def _sent(self) -> None:
        self.sending = False
        await self._sum_up_after_the_last()

    async def uploaded(self, event: UploadEventArguments) -> None:
        """Keep a file and read it; after the last, say what became of them."""
        self.coming += 1
        self.seen += 1
        self.sending = True  # until the browser says that it has sent all
        self.desk.changed("coming")
        shown = unescaped(event.file.name)
        try:
            with doing(f"Reading {shown:.40}"):
                await self._take(event, shown)
        except MckibbenError as error:
            self.problems.append(Problem(shown, error))
        except Exception as error:  # what nobody has foreseen must not keep the others waiting
            unforeseen = DataError(f"{type(error).__name__}: {error}", remedy="drop it again")
            self.problems.append(Problem(shown, unforeseen))
        finally:
            self.coming -= 1
        await self._sum_up_after_the_last()

    async def _sum_up_after_the_last(self) -> None:
        if (self.read or self.problems) and not self.coming and not self.sending:
            with told():
                await self._sum_up()

    async def _take(self, event: UploadEventArguments, shown: str) -> None:
        path = await kept(self.desk, event.file)
        async with self.one:
            if self.reading is not None:
                waiting = f" ({self.coming - 1} more)" if self.coming > 1 else ""
                self.reading.set_text(f"Reading {shown:.60}{waiting} …")
            try:
                found = await asyncio.to_thread(add, self.desk, path.name, shown, AS_FOUND)
                self.read.setdefault(shown, []).extend(found)
            except TooLargeError as error:  # nobody can be asked how it is to be read
                path.unlink(missing_ok=True)
                self.problems.append(Problem(shown, error))
            except MckibbenError as error:
                self.problems.append(Problem(shown, error, path.name))

    async def _sum_up(self) -> None:
        desk = self.desk
        read, self.read = self.read, {}
        problems, self.problems = self.problems, []
        told, self.told = self.seen - self.told, self.seen  # others may come in meanwhile
        self.reading.set_text("")
        self.left = [one for one in self.left if one.shown not in read]
        self.left += [one for one in problems if one.held]
        with self.place:
            if read:
                n = sum(map(len, read.values()))
                self.reading.set_text(f"Showing {n} recording{'s' * (n > 1)} …")
                await asyncio.to_thread(desk.workspace.warm)
                desk.settle_channels()
                desk.changed("recordings", "log")
                self._done(told)
                await desk.news.settled()
                if not self.coming:  # else it tells what is being read by now
                    self.reading.set_text("")
                tell_of(read)
            else:
                self._done(told)
            desk.changed("coming")
            self.show_left()
            if len(problems) == len(self.left) == 1 and not read:
                await self._ask(problems[0])
            elif len(problems) == 1 and not problems[0].held:
                tell(str(problems[0]))
            elif problems:
                self.list([one for one in problems if not one.held])

    def _done(self, files: int) -> None:
        """Take files off those that are just coming in."""
        self.seen -= files
        self.told -= files

    def show_left(self) -> None:
        """Show that there are files that were not read, until there are none."""
        if self.pending is not None:
            self.pending.set_text(f"{len(self.left)} file(s) not read: how are they to be?")
            self.pending.set_visibility(bool(self.left))

    async def _ask(self, one: Problem) -> None:
        """Ask how a file is to be read, and the others like it."""
        rest = [each for each in self.left if each is not one]

        async def then(left: list[Problem]) -> None:
            held = {each.held for each in left}
            done = {each.held for each in (one, *rest)} - held
            self.left = [each for each in self.left if each.held not in done]
            self.show_left()
            if done and self.left:
                self.list()

        path = self.desk.workspace.path("uploads", one.held)
        await ask(self.desk, self.place, path, one.shown, one.error, unread=rest, then=then)

    def list(self, foreign: Sequence[Problem] = ()) -> None:
        """Show all files that were not read; those that cannot be recordings by reason."""
        with (
            self.place,
            ui.dialog() as dialog,
            named(ui.card().classes("w-full max-w-3xl"), "not-read"),
        ):
            ui.label(f"{len(foreign) + len(self.left)} file(s) were not read").classes("text-lg")
            for alike in _by_reason(foreign):
                names = ", ".join(each.shown for each in alike[:LISTED])
                more = f" and {len(alike) - LISTED} more" if len(alike) > LISTED else ""
                reason = said(alike[0].error)
                lot = "kept" if "cannot be written" in reason else "recordings"
                ui.label(f"{len(alike)} cannot be {lot}: {names}{more}").classes("break-all")
                ui.label(reason).classes("text-sm opacity-70")
            for each in self.left[:LISTED]:
                with ui.row().classes("items-center w-full"):
                    ui.label(str(each)).classes("flex-1 text-sm break-words min-w-48")

                    async def mend(each: Problem = each) -> None:
                        dialog.close()
                        await self._ask(each)

                    ui.button("How is it to be read?", on_click=guarded(mend)).props("flat dense")
            if len(self.left) > LISTED:
                ui.label(f"and {len(self.left) - LISTED} more")
            named(ui.button("Close", on_click=dialog.close).props("flat"), "not-read-close")
        dialog.open()


def _by_reason(problems: Sequence[Problem]) -> list[list[Problem]]:
    """Return problems, those of the same reason together."""
    found: dict[str, list[Problem]] = {}
    for each in problems:
        words = str(each.error).replace(each.shown, "")
        found.setdefault(words.replace(Path(each.shown).suffix, ""), []).append(each)
    return list(found.values())[:LISTED]
