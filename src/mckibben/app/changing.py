"""Changes of recordings that can be undone: roles, names, steps, other readings, removal.

A change writes new files and descriptions, and keeps the old ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mckibben.app import kept
from mckibben.app.folder import short
from mckibben.app.recordings import Entry, Recordings, Role
from mckibben.errors import DataError

if TYPE_CHECKING:
    from mckibben.recording import Recording

MOST_CHANGES = 50
"""Changes that can be undone."""

HISTORY = "recordings"
"""Name of the history."""

_Contents = Mapping[str, dict[str, Any] | None]


class Changing(Recordings):
    """Recordings that can be changed, and every change undone.

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
                    self._remember(what, dict.fromkeys(added), after)

    def set_role(self, names: str | Sequence[str], role: Role) -> None:
        """Say what one recording or several are used for."""
        with self._changing:
            entries = [self.entry(name) for name in ([names] if isinstance(names, str) else names)]
            new = {each.name: replace(each, role=role) for each in entries if each.role != role}
            if new:
                self._change(f"{', '.join(new)} as {role}", new)

    def remove(self, *names: str) -> None:
        """Take recordings out of the workspace; what was uploaded stays."""
        for name in names:
            self.entry(name)
        self._change(f"remove {', '.join(names)}", dict.fromkeys(names))

    def rename(self, name: str, wish: str) -> str:
        """Give a recording another name, and return that: like the one wished for, and free."""
        entry, recording = self.entry(name), self.recording(name)
        chosen = self.new_name("recordings", wish)
        try:
            path = self._written(chosen, recording)
            self._change(
                f"rename {name} to {chosen}",
                {name: None, chosen: replace(entry, name=chosen, path=path)},
                {name: entry, chosen: entry},
            )
        except BaseException:
            self.give_back("recordings", chosen)
            raise
        return chosen

    def edit(self, name: str, what: str, *ways: Sequence[kept.Step]) -> list[str]:
        """Give a recording other steps; of several ways, each gives one, and the first keeps its name.

        Raises
        ------
        DataError
            If a step cannot be done.
        """
        from mckibben.app import edits

        entry = self.entry(name)
        base = self._read(entry.base or entry.path)
        made = [edits.applied(base, steps) for steps in ways]
        new: dict[str, Entry | None] = {}
        for each, steps in zip(made, ways, strict=True):
            chosen = self.new_name("recordings", name) if new else name
            path = self._written(chosen, each) if steps else entry.base or entry.path
            new[chosen] = replace(entry, name=chosen, path=path, steps=tuple(steps))
        self._change(what, new, dict.fromkeys(new, entry))
        return list(new)

    def take_back(
        self, name: str, what: str, seen: Sequence[kept.Step], place: int
    ) -> tuple[kept.Step, ...]:
        """Take back one of a recording's steps, and return those left; errors are those of `edit`.

        Parts cut out later span the time that they did, and not the samples of those numbers.

        Parameters
        ----------
        name, what : str
            Of the recording, and of the change, in words.
        seen : sequence of Step
            Those it had when one was chosen.
        place : int
            Of that one among them.
        """
        from mckibben.app import edits

        entry = self._unchanged(replace(self.entry(name), steps=tuple(seen)), what)
        base = self._read(entry.base or entry.path)
        spans = edits.spans(base, entry.steps)
        left = [(k, s) for k, s in enumerate(zip(entry.steps, spans, strict=True)) if k != place]
        steps = edits.spanning(base, *zip(*(pair for _, pair in left), strict=True)) if left else ()
        self.edit(name, what, steps)
        return steps

    def edit_each(self, names: Iterable[str], what: str, step: kept.Step) -> None:
        """Do one more step to each of some recordings, as one change; errors are those of `edit`."""
        from mckibben.app import edits

        new, begun = {}, {}
        for name in names:
            entry = begun[name] = self.entry(name)
            path = self._written(name, edits.applied(self.recording(name), [step]))
            new[name] = replace(
                entry, path=path, base=entry.base or entry.path, steps=(*entry.steps, step)
            )
        self._change(what, new, begun)

    def read_again(
        self,
        found: Mapping[str, tuple[Sequence[Recording], str]],
        reading: kept.Reading,
        uploads: Mapping[str, str] | None = None,
    ) -> list[str]:
        """Replace what was read by what was read otherwise; steps are done anew.

        Parts that were cut out span the time that they did, unless the rate was read otherwise. Of
        several recordings, one for each stretch, those that were not there before are added; stretches
        that are not cut out any more go.

        Parameters
        ----------
        found : mapping of str to (sequence of Recording, str)
            By the names of recordings, what is in their files now, and the call that reads it.
        reading : Reading
            How it was read.
        uploads : mapping of str to str, optional
            The files among the uploads, where they are others than before.
        """
        from mckibben.app import edits

        new: dict[str, Entry | None] = {}
        begun = {}
        for name, (read, call) in found.items():
            if name in new:  # a stretch of what was read otherwise already
                continue
            entry = self.entry(name)
            places = [entry.part] if entry.part < len(read) else [0]
            if entry.reading.gaps != "split" and reading.gaps == "split":
                places = list(range(len(read)))
            elif entry.reading.gaps == "split" and reading.gaps != "split":
                new.update(dict.fromkeys(self._stretches(entry)))
            for place in places:
                steps = self._again(entry, read[place])
                each = edits.applied(read[place], steps)
                again = name in new and new[name] is not None
                chosen = self.new_name("recordings", name) if again else name
                base = path = self._written(chosen, read[place])
                if steps:
                    path = self._written(chosen, each)
                way = replace(entry, name=chosen, path=path, base=base, call=f"{call}[{place}]")
                upload = (uploads or {}).get(name, entry.upload)
                way = replace(way, part=place, reading=reading, steps=steps, upload=upload)
                new[chosen], begun[chosen] = replace(way, notes=read[place].notes), entry
        self._change(f"read {', '.join(found)} otherwise", new, begun)
        return [name for name, each in new.items() if each]

    def _stretches(self, entry: Entry) -> list[str]:
        """Return the recordings that were cut out of the same reading of a file, this one among them."""
        return [
            each.name
            for each in self.entries()
            if (each.upload, each.reading) == (entry.upload, entry.reading)
        ]

    def _again(self, entry: Entry, read: Recording) -> tuple[kept.Step, ...]:
        """Return the steps of a recording for what was read otherwise."""
        from mckibben.app import edits

        try:
            before = self._read(entry.base or entry.path)
            if before.sample_time == read.sample_time and len(before) != len(read):
                return edits.spanning(read, entry.steps, edits.spans(before, entry.steps))
        except (
            DataError
        ):  # what was read before is damaged, or its parts are not in what is read now
            pass
        return entry.steps

    def _change(
        self, what: str, new: Mapping[str, Entry | None], begun: Mapping[str, Entry] | None = None
    ) -> None:
        """Put what is new, unless that of which it was made is not there any more.

        Parameters
        ----------
        what : str
            In words.
        new : mapping
            By name; None where there is none.
        begun : mapping, optional
            By name, that of which it was made; only roles may have changed since, and are kept.
        """
        self.demand()
        with self._changing:
            try:
                roles = {
                    name: self._unchanged(one, what).role for name, one in (begun or {}).items()
                }
            except DataError:
                self._drop(
                    path.name for e in new.values() if e for path in (e.path, e.base) if path
                )
                raise
            new = {n: replace(e, role=roles.get(n, e.role)) if e else e for n, e in new.items()}
            after = {name: None if each is None else each.content() for name, each in new.items()}
            before = {name: self.read_json("recordings", name) for name in new}
            self._put(after)
            self._remember(what, before, after)
        self.log(what)

    def _remember(self, what: str, before: _Contents, after: _Contents) -> None:
        history = self._history()
        change = kept.Change(what=short(what), before=dict(before), after=dict(after))
        done = [*history.done, change]
        gone = [*history.undone, *done[:-MOST_CHANGES]]
        self._keep(kept.History(done=done[-MOST_CHANGES:]), gone)

    def _unchanged(self, entry: Entry, what: str) -> Entry:
        """Return what a recording is now, of which nothing but the role may have changed."""
        now = self.entry(entry.name) if entry.name in self.names("recordings") else None
        if now is None or replace(now, role=entry.role) != entry:
            raise DataError(
                f"{entry.name!r} was changed or removed meanwhile, so that this was not done: {what}",
                remedy="do it to what is there now",
            )
        return now

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
            there.append(change)
            self._put(change.before if undo else change.after)
            self._keep(history, [])
        self.log(f"{'undid' if undo else 'did again'}: {change.what}")
        return change.what

    def history(self) -> tuple[str | None, str | None]:
        """Return what would be undone, and what would be done again."""
        history = self._history()
        done, undone = history.done, history.undone
        return done[-1].what if done else None, undone[-1].what if undone else None

    def _history(self) -> kept.History:
        found = kept.checked(kept.History, self.read_json("history", HISTORY))
        return kept.History() if found is None else found

    def _keep(self, history: kept.History, gone: Iterable[kept.Change]) -> None:
        """Write the history; samples that only forgotten changes have are removed."""
        self.write_json("history", HISTORY, history.model_dump(mode="json"))
        files = {name for change in gone for name in _files(change)}
        files -= {name for change in (*history.done, *history.undone) for name in _files(change)}
        self._drop(files)

    def _drop(self, files: Iterable[str]) -> None:
        """Remove files of samples that no recording has."""
        for name in set(files) - {
            path.name for e in self.entries() for path in (e.path, e.base) if path
        }:
            with suppress(OSError, DataError):
                path = self.path("recordings", name)
                path.unlink()
                path.with_name(f"{name}-metadata.json").unlink()

    def _put(self, contents: _Contents) -> None:
        for name, content in contents.items():
            if content is None:
                self.new_path("recordings", f"{name}.json").unlink(missing_ok=True)
            else:
                self.write_json("recordings", name, content)


def _files(change: kept.Change) -> set[str]:
    found = (
        kept.checked(kept.Described, each)
        for each in (*change.before.values(), *change.after.values())
    )
    return {name for each in found if each for name in (each.file, each.base) if name}
