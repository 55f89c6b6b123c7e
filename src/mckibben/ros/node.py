"""A compensator between topics: references in, pressures out, safe when nobody speaks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.errors import DataError, ModelError
from mckibben.ros.kinds import KINDS, Kind
from mckibben.ros.messages import good, message, numbers, serialized
from mckibben.ros.recording import Recorder

MOST_PRESSURE = 1000.0
"""Of any muscle [bar]."""

LONGEST_SILENCE = 60.0
"""That a watchdog may be told to bear [s]."""


class Heard(Protocol):
    """A subscription."""

    def newest(self) -> Any | None:
        """Return the newest message since the last call, or None."""


class Spoken(Protocol):
    """A publication."""

    def send(self, message: Any) -> None:
        """Send a message."""


class Transport(Protocol):
    """What brings and takes messages."""

    def subscribe(self, name: str, kind: Kind) -> Heard:
        """Return a subscription."""

    def publish(self, name: str, kind: Kind) -> Spoken:
        """Return a publication."""


@dataclass(frozen=True)
class Topic:
    """A topic of the node.

    Parameters
    ----------
    name : str
    kind : Kind, optional
        Default Float64 for one number, Float64MultiArray for several.
    """

    name: str
    kind: Kind | None = None

    def carrying(self, channels: tuple[Channel, ...]) -> Kind:
        """Return its type where it carries some channels.

        Raises
        ------
        DataError
            If it cannot carry them.
        """
        kind = self.kind or KINDS["Float64" if len(channels) == 1 else "Float64MultiArray"]
        if kind.single and len(channels) != 1:
            names = ", ".join(channel.name for channel in channels)
            raise DataError(
                f"{kind.name} carries one number, and {self.name} has {len(channels)}: {names}",
                remedy="use Float64MultiArray",
            )
        return kind


class Node:
    """A compensator, or controller, that runs between topics.

    References are the block's driven inputs, in order; what is measured the others. Where either is
    silent for longer than ``timeout``, the pressure is ``safe``; with the next messages the block goes
    on from its memory, and from what it has learnt.

    Parameters
    ----------
    block : Block
        Whose outputs are pressures.
    transport : Transport
    reference, pressure : Topic
    measured : Topic, optional
        Needed by a block that asks for more than references.
    highest, lowest : float
        Pressures are clipped to these [bar].
    safe : float
        Pressure without references [bar].
    timeout : float
        Longest silence [s].
    period : float
        Time between steps [s].
    record : Path, optional
        MCAP to write.

    Attributes
    ----------
    refused : int
        Messages whose numbers were not finite, or not as many as wanted.
    silences : int
        How often the watchdog acted.
    """

    def __init__(
        self,
        block: Block,
        transport: Transport,
        *,
        reference: Topic,
        pressure: Topic,
        measured: Topic | None = None,
        highest: float,
        lowest: float = 0.0,
        safe: float = 0.0,
        timeout: float = 0.2,
        period: float = 0.01,
        record: Path | None = None,
    ) -> None:
        if not -MOST_PRESSURE <= lowest <= safe <= highest <= MOST_PRESSURE:
            raise DataError(
                f"a safe pressure of {safe:g} bar within {lowest:g} to {highest:g}",
                remedy=f"give lowest <= safe <= highest, within {MOST_PRESSURE:g}",
            )
        if not 0 < period <= timeout <= LONGEST_SILENCE:
            raise DataError(
                f"a time-out of {timeout:g} s and a step of {period:g} s",
                remedy=f"let a silence be at least one step, and at most {LONGEST_SILENCE:g} s",
            )
        if any(channel.unit != "bar" for channel in block.outputs):
            raise ModelError(
                f"{block.title!r} gives {block.outputs[0].name}, not pressures",
                remedy="give the compensator, from mckibben invert",
            )
        n = len(block.inputs) - len(block.scheduling)
        wanted, others = block.inputs[:n], block.inputs[n:]
        if others and measured is None:
            names = ", ".join(channel.name for channel in others)
            raise DataError(f"{block.title!r} needs {names}", remedy="give --measured TOPIC")
        self._stream = block.stream(period)
        self._limits, self._safe, self._timeout = (lowest, highest), safe, timeout
        self._reference = _Ear(transport, reference, wanted)
        self._measured = None
        if measured is not None:
            # where the block asks for nothing, it is heard for the recording
            seen = others or tuple(wanted)
            self._measured = _Ear(transport, measured, seen, needed=bool(others))
        self._mouth = _Mouth(transport, pressure, block.outputs)
        self._silent, self._stepped = True, False
        self.silences = 0
        # only now, for a file that is refused is not begun
        self._recorder = Recorder(record) if record is not None else None
        if self._recorder is not None:
            for each in (*self._ears(), self._mouth):
                each.record(self._recorder)

    @property
    def refused(self) -> int:
        """Messages that were not taken."""
        return sum(ear.refused for ear in self._ears())

    def step(self, now: float, when: int) -> list[float]:
        """Take what has come, and give pressures.

        Parameters
        ----------
        now : float
            Time of a clock that only goes forward [s].
        when : int
            Time of day, for stamps [ns since 1970].

        Returns
        -------
        list of float
            What was published [bar].
        """
        for ear in self._ears():
            ear.listen(now, when)
        needed = [ear for ear in self._ears() if ear.needed]
        if any(now - ear.heard > self._timeout for ear in needed):
            if not self._silent:
                self.silences += 1
            self._silent = True
            pressures = [self._safe] * len(self._mouth.channels)
        else:
            self._silent, self._stepped = False, True
            given = self._stream.step([value for ear in needed for value in ear.values])
            low, high = self._limits
            pressures = [min(max(value, low), high) for value in given.tolist()]
        self._mouth.speak(pressures, when)
        return pressures

    def run(
        self, turns: Iterable[object], clock: Callable[[], float], day: Callable[[], int]
    ) -> None:
        """Step at every turn; when it ends, however it does, say the safe pressure."""
        try:
            for _ in turns:
                self.step(clock(), day())
        finally:
            try:
                self._mouth.speak([self._safe] * len(self._mouth.channels), day())
            finally:  # the recording may be what ended it
                self.close()

    @property
    def led(self) -> bool:
        """Whether a reference ever came."""
        return self._reference.heard > -math.inf

    @property
    def state(self) -> Array | None:
        """What the block remembers; None where it took no step."""
        return self._stream.state if self._stepped else None

    def close(self) -> None:
        """End the recording."""
        if self._recorder is not None:
            self._recorder.close()

    def _ears(self) -> list[_Ear]:
        return [self._reference, *([self._measured] if self._measured is not None else [])]


class _Recorded:
    """A topic whose messages may be recorded."""

    def __init__(self, topic: Topic, channels: tuple[Channel, ...]) -> None:
        self.channels, self.kind = channels, topic.carrying(channels)
        self.factors = [self.kind.factor(channel.unit) for channel in channels]
        self._name = topic.name
        self._recorder: Recorder | None = None
        self._number = 0

    def record(self, recorder: Recorder) -> None:
        """Let its messages be recorded from now on."""
        self._recorder, self._number = recorder, recorder.topic(self._name, self.kind)

    def kept(self, found: Any, when: int) -> None:
        """Record a message, if messages are."""
        if self._recorder is not None:
            self._recorder.write(self._number, when, serialized(found))


class _Ear(_Recorded):
    """A topic that is heard."""

    def __init__(
        self,
        transport: Transport,
        topic: Topic,
        channels: tuple[Channel, ...],
        *,
        needed: bool = True,
    ) -> None:
        super().__init__(topic, channels)
        self.needed = needed
        self._from = transport.subscribe(topic.name, self.kind)
        self.values: list[float] = []
        self.heard, self.refused = -math.inf, 0

    def listen(self, now: float, when: int) -> None:
        """Take the newest message, if one came."""
        found = self._from.newest()
        if found is None:
            return
        self.kept(found, when)
        values = numbers(self.kind, found)
        if not good(values, len(self.channels)):
            self.refused += 1
            return
        self.values = [v / factor for v, factor in zip(values, self.factors, strict=True)]
        self.heard = now


class _Mouth(_Recorded):
    """The topic that is spoken to."""

    def __init__(self, transport: Transport, topic: Topic, channels: tuple[Channel, ...]) -> None:
        super().__init__(topic, channels)
        self._to = transport.publish(topic.name, self.kind)

    def speak(self, values: list[float], when: int) -> None:
        """Publish numbers in the channels' units."""
        scaled = [v * factor for v, factor in zip(values, self.factors, strict=True)]
        said = message(self.kind, scaled, [channel.name for channel in self.channels], when)
        self._to.send(said)
        self.kept(said, when)
