"""Questions over a line, asked again until they are answered; and what was lost is counted."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from mckibben.errors import DataError, require
from mckibben.link.device import ANSWER, Kind, Status, unfit
from mckibben.link.framing import Frame, Reader
from mckibben.link.ports import ByteStream

WORDS = 1 << 32

KEPT = 100_000
"""Samples that wait to be taken, at most: the latest."""


class LinkError(DataError):
    """A device that does not answer, refuses, or is not what it was."""


class LostError(LinkError):
    """The device knows nothing of the session any more, or has let go."""


@dataclass
class Statistics:
    """What a link has counted.

    Parameters
    ----------
    asked, answered : int
        Frames that were to be carried out, and answers to them.
    repeated : int
        Frames that were sent again, for want of an answer in time.
    dropped : int
        Pieces that came and were no frames, or answers to nothing that was asked.
    reopened : int
        How often the device was led again, after its watchdog had acted or it had been switched off.
    """

    asked: int = 0
    answered: int = 0
    repeated: int = 0
    dropped: int = 0
    reopened: int = 0


class Exchange:
    """Asks over a stream of bytes.

    Parameters
    ----------
    stream : ByteStream
        What bytes go over.
    timeout, patience : float
        After what time without an answer to ask again, and to give up [s].
    clock : callable
        Time in seconds.

    Attributes
    ----------
    session : int
        Of the device, by its last answer.
    samples : deque of Frame
        What it told by itself.
    """

    def __init__(
        self, stream: ByteStream, *, timeout: float, patience: float, clock: Callable[[], float]
    ) -> None:
        wanted = f"a positive time up to the patience, {patience:g} s"
        require(0 < timeout <= patience, "timeout", timeout, wanted, DataError)
        self.stream, self.clock = stream, clock
        self._timeout, self._patience = timeout, patience
        self._reader = Reader()
        # no answer to an earlier program has these numbers
        self._sequence = int.from_bytes(os.urandom(4), "little")
        self.session = 0
        self.samples: deque[Frame] = deque(maxlen=KEPT)
        self.statistics = Statistics()

    def ask(self, kind: Kind, body: bytes = b"", *, session: int = 0) -> bytes:
        """Send a frame until it is answered, and return what the answer says.

        Raises
        ------
        LinkError
            If nothing answers, or the device refuses.
        LostError
            If it knows no such session.
        """
        self._sequence = (self._sequence + 1) % WORDS
        packed = Frame(kind, session, self._sequence, body).packed()
        until = self.clock() + self._patience
        self.statistics.asked += 1
        self.stream.write(packed)
        asked = self.clock()
        while (answer := self.take(asked + self._timeout - self.clock(), kind)) is None:
            now = self.clock()
            if now >= until:
                raise LinkError(
                    f"nothing has answered for {self._patience:g} s",
                    remedy="see that the device is on, that this is its port and rate, and that "
                    "nothing else talks to it",
                )
            if now >= asked + self._timeout:
                # a zero first, which ends whatever noise has begun
                self.stream.write(b"\0" + packed)
                self.statistics.repeated += 1
                asked = now
        self.statistics.answered += 1
        self.session = answer.session
        return self._content(kind, answer)

    def _content(self, kind: Kind, answer: Frame) -> bytes:
        try:
            status = Status(answer.body[0])
        except (IndexError, ValueError):
            raise unfit("an answer") from None
        words = status.name.lower().replace("_", " ")
        if status in (Status.NO_SESSION, Status.IS_SAFE, Status.OLD_SESSION):
            raise LostError(
                f"the device leads no more: {words}",
                remedy="see what has kept the host silent or has switched the device off, and open the "
                "link again",
            )
        if status != Status.OK:
            raise LinkError(
                f"the device refuses {kind.name}: {words}",
                remedy="see docs/deploy/link.md for what that means",
            )
        return answer.body[1:]

    def take(self, timeout: float, kind: Kind | None = None) -> Frame | None:
        """Read once, keep samples, and return the answer that is waited for if it is there."""
        found: Frame | None = None
        for frame in self._reader.feed(self.stream.read(max(timeout, 0.0))):
            if frame.kind == Kind.SAMPLE | ANSWER:
                self.samples.append(frame)
            elif kind is not None and (frame.kind, frame.sequence) == (
                kind | ANSWER,
                self._sequence,
            ):
                found = frame
            else:
                self.statistics.dropped += 1
        self.statistics.dropped += self._reader.dropped
        self._reader.dropped = 0
        return found
