"""Every change of recordings can be undone: descriptions as they were are kept, and their samples.

A change is put as a whole: on a full disk, or where the process is killed, nothing is lost between what
was and what is to be.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from mckibben.app import kept
from mckibben.app.folder import short
from mckibben.app.recordings import Recordings
from mckibben.errors import DataError
from mckibben.system.atomic import replacing, written
from mckibben.system.ordinary import DESCRIPTION

MOST_CHANGES = 50
"""Changes that can be undone."""

HISTORY = "recordings"
"""Name of the history."""

UNDER_WAY = ".changing"
"""Stands in the folder while a change is put, and after one in which the process was killed."""

_Contents = Mapping[str, dict[str, Any] | None]


class Undoing(Recordings):
    """Recordings of which every change can be undone.

    Parameters, and errors, are those of `mckibben.app.folder.Folder`.
    """

    @contextmanager
    def adding(self, what: str) -> Iterator[list[str]]:
        """Give a list for the names of recordings that are added, as one change that can be undone."""
        added: list[str] = []
        try:
            yield added
        finally:
            if added:
                with self._changing:
                    after = {name: self.read_json("recordings", name) for name in added}
                    self._remember(what, dict.fromkeys(added), after, put=False)

    def undo(self) -> str | None:
        """Take the last change back, and return what it was; None if there is none."""
        return self._step_back(undo=True)

    def redo(self) -> str | None:
        """Do again what was undone last, and return what it was; None if there is nothing."""
        return self._step_back(undo=False)

    def _step_back(self, *, undo: bool) -> str | None:
        self.demand()
        with self._changing:
            history = self._history()
            here, there = (history.done, history.undone) if undo else (history.undone, history.done)
            if not here:
                return None
            change = here.pop()
            left, put = (change.after, change.before) if undo else (change.before, change.after)
            if not self._can_put(left, put):
                self._keep(history, {})
                raise DataError(
                    f"{change.what:.200}: this cannot be {'undone' if undo else 'done again'}, for what "
                    "it is about was changed from elsewhere; it is passed over",
                    remedy="press again for the change next to it",
                )
            there.append(change)
            self._keep(history, put)
        self._noted(f"{'undid' if undo else 'did again'}: {change.what}")
        return change.what

    def _can_put(self, left: _Contents, put: _Contents) -> bool:
        """Tell whether recordings are as a change left them, and can be what they are to be."""
        try:
            for name, content in put.items():
                self.path("recordings", f"{name}.json")
                if self.read_json("recordings", name) not in (left.get(name), content):
                    return False
                if content is not None:
                    self._described(name, content)
        except DataError:
            return False
        return True

    def history(self) -> tuple[str | None, str | None]:
        """Return what would be undone, and what would be done again."""
        history = self._history()
        done, undone = history.done, history.undone
        return done[-1].what if done else None, undone[-1].what if undone else None

    def _history(self) -> kept.History:
        found = kept.checked(kept.History, self.read_json("history", HISTORY))
        return kept.History() if found is None else found

    def _keep(self, history: kept.History, put: _Contents) -> None:
        """Write the history and put descriptions: all of it, or on a full disk nothing.

        All is written before any of it is seen. The history is seen first and what is removed goes last,
        so that no recording is ever out of the list and out of the reach of undoing. Where the process
        is killed between, the next that opens the folder completes the change.
        """
        history = _fitting(history)
        contents = {self.new_path("recordings", f"{n}.json"): each for n, each in put.items()}
        under_way = self.folder / UNDER_WAY
        with written(under_way):
            under_way.touch(mode=0o600)
        with ExitStack() as seen:  # the last first
            for path, content in contents.items():
                if content is not None:
                    new = seen.enter_context(replacing(path))
                    new.write_text(json.dumps(content, indent=2) + "\n")
            new = seen.enter_context(replacing(self.new_path("history", f"{HISTORY}.json")))
            new.write_text(_text(history))
        for path, content in contents.items():
            if content is None:
                with written(path):
                    path.unlink(missing_ok=True)
        with written(under_way):
            under_way.unlink(missing_ok=True)

    def _tidy(self) -> None:
        """Complete also a change in which a process was killed, and set a damaged history aside."""
        super()._tidy()
        with suppress(DataError, OSError):
            path = self.path("history", f"{HISTORY}.json")
            if (
                path.is_file()
                and kept.checked(kept.History, self.read_json("history", HISTORY)) is None
            ):
                aside = f"{self.new_name('history', 'damaged')}.json"
                path.replace(self.new_path("history", aside))
                self.log(
                    f"earlier changes cannot be undone: their list was damaged, and is now {aside}"
                )
        if not (self.folder / UNDER_WAY).exists():
            return
        history = self._history()
        ways = [(one.before, one.after) for one in history.done[-1:]]
        ways += [(one.after, one.before) for one in history.undone[-1:]]
        with suppress(DataError, OSError):
            for left, put in ways:
                if self._can_put(left, put):
                    self._keep(history, put)
            (self.folder / UNDER_WAY).unlink(missing_ok=True)

    def _remember(
        self, what: str, before: _Contents, after: _Contents, *, put: bool = True
    ) -> None:
        """Keep a change and put what comes of it, unless that is there already."""
        history = self._history()
        change = kept.Change(what=short(what), before=dict(before), after=dict(after))
        self._keep(kept.History(done=[*history.done, change]), after if put else {})
        self._drop(_files(history))

    def _noted(self, what: str, call: str = "") -> None:
        with suppress(DataError):  # what is done is done, where the log has no room
            self.log(what, call)

    def _drop(self, files: Iterable[str]) -> None:
        """Remove files of samples that no recording has, or can have again."""
        known = {path.name for e in self.entries() for path in (e.path, e.base) if path}
        for name in set(files) - known - _files(self._history()):
            with suppress(OSError, DataError):
                path = self.path("recordings", name)
                path.unlink()
                path.with_name(f"{name}-metadata.json").unlink()


def _fitting(history: kept.History) -> kept.History:
    """Return a history without the oldest changes, where all are too many, or too much to be read again.

    Raises
    ------
    DataError
        If one change alone is too much.
    """
    done, undone = history.done[-MOST_CHANGES:], list(history.undone)
    while len(_text(found := kept.History(done=done, undone=undone))) > DESCRIPTION:
        if len(done) + len(undone) < 2:
            raise DataError(
                "these are too many recordings for one change that can be undone",
                remedy="change fewer at once",
            )
        (undone or done).pop(0)
    return found


def _text(history: kept.History) -> str:
    return json.dumps(history.model_dump(mode="json"), separators=(",", ":")) + "\n"


def _files(history: kept.History) -> set[str]:
    """Return the files of samples that undoing and doing again may bring back."""
    changes = (*history.done, *history.undone)
    contents = (each for one in changes for each in (*one.before.values(), *one.after.values()))
    found = (kept.checked(kept.Described, each) for each in contents)
    return {name for each in found if each for name in (each.file, each.base) if name}
