"""Changes of recordings: roles, names, steps, other readings, removal; each can be undone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from mckibben.app import kept
from mckibben.app.recordings import EXAMPLE, Entry, Role
from mckibben.app.undoing import Undoing
from mckibben.errors import DataError

if TYPE_CHECKING:
    from mckibben.recording import Recording


class Changing(Undoing):
    """Recordings that can be changed.

    Parameters, and errors, are those of `mckibben.app.folder.Folder`.
    """

    def add_example(self) -> list[str]:
        """Add the bundled recordings that are not there yet, and return their names."""
        from mckibben import example
        from mckibben.files import read

        with self._changing, self.adding("open the example") as added:
            there = {entry.call for entry in self.entries() if entry.origin == EXAMPLE}
            for word, role in (("TRAIN", "train"), ("TEST", "test")):
                call = f"mckibben.read(mckibben.example.{word})[0]"
                if call not in there:
                    (recording,) = read(getattr(example, word))
                    entry = self.add(recording, origin=EXAMPLE, call=call, role=role)  # type: ignore[arg-type]
                    added.append(entry.name)
        return added

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

    def edit(
        self,
        name: str,
        what: str,
        *ways: Sequence[kept.Step],
        seen: Sequence[kept.Step] | None = None,
    ) -> list[str]:
        """Give a recording other steps; of several ways, each gives one, and the first keeps its name.

        Parameters
        ----------
        name, what : str
            Of the recording, and of the change, in words.
        ways : sequence of Step
        seen : sequence of Step, optional
            Those it had when these were chosen.

        Raises
        ------
        DataError
            If a step cannot be done, or another one was done since.
        """
        from mckibben.app import edits

        entry = self.entry(name)
        if seen is not None:
            entry = self._unchanged(replace(entry, steps=tuple(seen)), what)
        base = self._read(entry.base or entry.path)
        made = [edits.applied(base, steps) for steps in ways]
        new: dict[str, Entry | None] = {}
        for each, steps in zip(made, ways, strict=True):
            chosen = self.new_name("recordings", name) if new else name
            path = self._written(chosen, each) if steps else entry.base or entry.path
            new[chosen] = replace(entry, name=chosen, path=path, steps=tuple(steps))
        call = edits.call("recording", ways[0])
        self._change(what, new, dict.fromkeys(new, entry), call)
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
        self._change(what, new, begun, f"[{edits.call('one', [step])} for one in recordings]")

    def read_again(
        self,
        found: Mapping[str, tuple[Sequence[Recording], str]],
        readings: kept.Reading | Mapping[str, kept.Reading],
        uploads: Mapping[str, str] | None = None,
    ) -> list[str]:
        """Replace what was read by what was read otherwise; steps are done anew.

        Parts that were cut out span the time that they did, unless the rate was read otherwise. Steps
        follow their channels to other names; those whose channels are gone are left out, and noted. Of
        several recordings, one for each stretch, those that were not there before are added; stretches
        that are not cut out any more go.

        Parameters
        ----------
        found : mapping of str to (sequence of Recording, str)
            By the names of recordings, what is in their files now, and the call that reads it.
        readings : Reading or mapping of str to Reading
            How all of it was read, or each by its recording's name.
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
            reading = readings if isinstance(readings, kept.Reading) else readings[name]
            places = [entry.part] if entry.part < len(read) else [0]
            if entry.reading.gaps != "split" and reading.gaps == "split":
                places = list(range(len(read)))
            elif entry.reading.gaps == "split" and reading.gaps != "split":
                new.update(dict.fromkeys(self._stretches(entry)))
            names = self._names_now(entry, reading)
            for place in places:
                steps, lost = self._again(entry, read[place], names)
                each = edits.applied(read[place], steps)
                again = name in new and new[name] is not None
                chosen = self.new_name("recordings", name) if again else name
                base = path = self._written(chosen, read[place])
                if steps:
                    path = self._written(chosen, each)
                way = replace(entry, name=chosen, path=path, base=base, call=f"{call}[{place}]")
                upload = (uploads or {}).get(name, entry.upload)
                way = replace(way, part=place, reading=reading, steps=steps, upload=upload)
                new[chosen], begun[chosen] = replace(way, notes=(*read[place].notes, *lost)), entry
        call = "\n".join(dict.fromkeys(call for _, call in found.values()))
        self._change(f"read {', '.join(found)} otherwise", new, begun, call)
        return [name for name, each in new.items() if each]

    def _stretches(self, entry: Entry) -> list[str]:
        """Return the recordings that were cut out of the same reading of a file, this one among them."""
        return [
            each.name
            for each in self.entries()
            if (each.upload, each.reading) == (entry.upload, entry.reading)
        ]

    def _names_now(self, entry: Entry, reading: kept.Reading) -> dict[str, str]:
        """Return what channels are called in another reading of their columns; empty where none."""
        from mckibben.app.reading import columns

        same = entry.reading.columns == reading.columns
        if same or not any(step.channels or step.over for step in entry.steps):
            return {}
        path = self.path("uploads", entry.upload)
        pairs = zip(columns(path, entry.reading), columns(path, reading), strict=False)
        return {old.channel: new.channel for old, new in pairs if old.channel}

    def _again(
        self, entry: Entry, read: Recording, names: Mapping[str, str]
    ) -> tuple[tuple[kept.Step, ...], tuple[str, ...]]:
        """Return the steps of a recording for what was read otherwise, and what to say of them."""
        from mckibben.app import edits

        now = [edits.renamed(step, names, read) for step in entry.steps]
        steps = tuple(step for step in now if step)
        lost = tuple(
            f"left out, as its channel is not there any more: {edits.words(step)}"
            for step, new in zip(entry.steps, now, strict=True)
            if new is None
        )
        # where what was read before is damaged, or its parts are not in what is read now
        with suppress(DataError):
            before = self._read(entry.base or entry.path)
            if before.sample_time == read.sample_time and len(before) != len(read):
                spans = zip(edits.spans(before, entry.steps), now, strict=True)
                return edits.spanning(read, steps, [span for span, new in spans if new]), lost
        return steps, lost

    def _change(
        self,
        what: str,
        new: Mapping[str, Entry | None],
        begun: Mapping[str, Entry] | None = None,
        call: str = "",
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
        call : str, optional
            The Python that does it.
        """
        self.demand()
        with self._changing:
            try:
                roles = {
                    name: self._unchanged(one, what).role for name, one in (begun or {}).items()
                }
                put = {n: replace(e, role=roles.get(n, e.role)) if e else e for n, e in new.items()}
                after = {name: each.content() if each else None for name, each in put.items()}
                before = {name: self.read_json("recordings", name) for name in new}
                self._remember(what, before, after)
            except DataError:
                self._drop(
                    path.name for e in new.values() if e for path in (e.path, e.base) if path
                )
                for name in new:
                    self.give_back("recordings", name)
                raise
        self._noted(what, call)

    def _unchanged(self, entry: Entry, what: str) -> Entry:
        """Return what a recording is now, of which nothing but the role may have changed."""
        now = self.entry(entry.name) if entry.name in self.names("recordings") else None
        if now is None or replace(now, role=entry.role) != entry:
            raise DataError(
                f"{entry.name!r} was changed or removed meanwhile, so that this was not done: {what}",
                remedy="do it to what is there now",
            )
        return now
