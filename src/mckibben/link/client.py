"""A host's end of the serial line to an exported model; docs/deploy/link.md is the protocol."""

from __future__ import annotations

import os
import struct
import time
import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from serial import Serial

VERSION, ANSWER, WORD, WORDS = 2, 0x80, 0xFFFF, 1 << 32
HEAD, CHECK = struct.Struct("<BB4sI"), struct.Struct("<I")
PAYLOAD = 250
ROOM = PAYLOAD - HEAD.size - CHECK.size  # bytes of a body, at most
STATUSES = ("ok", "malformed", "beyond limits", "another model is there")

Inputs = ArrayLike | Mapping[str, float]
"""Values of a device's inputs, in their order or by name."""

Kind = IntEnum("Kind", "IDENTIFY STATE READ INPUTS RESET RELEASE SAMPLE")
Note = IntFlag("Note", "RUNNING TRIPPED LIMITED BAD_INPUT BAD_OUTPUT RESUMED CLIPPED")


class LinkError(DataError):
    """A device that does not answer, refuses, or is not what it was.

    Attributes
    ----------
    status : int
        Why the device refused, a place in `STATUSES`; 0 where it did not.
    """

    status: int = 0


class Frame(NamedTuple):
    """A message: its kind, the first bytes of the model's fingerprint, a number, a body."""

    kind: int
    model: bytes
    sequence: int
    body: bytes = b""

    def packed(self) -> bytes:
        """Return its bytes: checked (CRC-32), and without a zero but at the end (COBS)."""
        content = HEAD.pack(VERSION, *self[:3]) + self.body
        parts = (content + CHECK.pack(zlib.crc32(content))).split(b"\0")
        return b"".join(bytes([len(part) + 1]) + part for part in parts) + b"\0"


def unpacked(piece: bytes) -> Frame | None:
    """Return the frame of the bytes before a zero, or None where they are none."""
    parts, position = [], 0
    while position < len(piece):
        parts.append(piece[position + 1 : position + piece[position]])
        position += piece[position]
    content = b"\0".join(parts)
    if position != len(piece) or not HEAD.size + CHECK.size <= len(content) <= PAYLOAD:
        return None
    content, check = content[: -CHECK.size], content[-CHECK.size :]
    version, kind, model, sequence = HEAD.unpack_from(content)
    if version != VERSION or CHECK.pack(zlib.crc32(content)) != check:
        return None
    return Frame(kind, model, sequence, content[HEAD.size :])


@dataclass(frozen=True)
class Port:
    """A channel of a device, its limits, and, of an output, the value without a host."""

    name: str
    unit: str
    low: FiniteFloat
    high: FiniteFloat
    safe: FiniteFloat


@dataclass(frozen=True)
class Device:
    """What a device is, as in ``link.json``: its time between ticks [s], longest silence [ticks], ...

    ``n_memory`` numbers of the memory can be read; the last ``n_missable`` inputs may be NaN.
    """

    fingerprint: Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
    period: Annotated[FiniteFloat, Field(gt=0)]
    silence: Annotated[int, Field(gt=0, lt=WORDS)]
    numbers: Literal["float32", "float64"]
    n_memory: Annotated[int, Field(ge=0, le=WORD)]
    n_missable: Annotated[int, Field(ge=0)]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


@dataclass(frozen=True)
class State:
    """The state of a device after so many steps, modulo 2^32, when it was received [s]."""

    notes: Note
    steps: int
    outputs: Array
    inputs: Array
    time: float = 0.0

    @property
    def is_safe(self) -> bool:
        """Whether the outputs are the safe ones, as no host sends inputs."""
        return Note.RUNNING not in self.notes


@dataclass
class Statistics:
    """How often a frame was sent again, a piece was no frame, and a device had to be resumed."""

    repeated: int = 0
    dropped: int = 0
    resumed: int = 0


class Link(AbstractContextManager["Link"]):
    """Drives a model on a device over a serial line.

    A frame without an answer is sent again under the same number: the device executes each command
    once, in order, or not at all, even if the line loses or damages frames. Inputs carry all settings:
    the next ones resume a device that was reset, or whose watchdog has acted; `statistics` counts it.

    Parameters
    ----------
    port : str, Path or serial.Serial
        Port to open, such as /dev/ttyACM0 or COM3, or one that is open.
    baud : int
        Rate of a port that is to be opened [bits/s].
    lock_step : bool
        Whether each `step` steps the model; else the device's timer does, with the inputs of `set`.
    watchdog : float, optional
        Time without inputs after which outputs become safe [s]; default that of the export, the longest.
    fingerprint : str, optional
        Of the model that must be on the device, as in the export's ``link.json``.
    timeout, patience : float
        Without an answer, the times after which a frame is sent again, and given up [s].
    """

    def __init__(
        self,
        port: str | Path | Serial,
        *,
        baud: int = 115200,
        lock_step: bool = False,
        watchdog: float | None = None,
        fingerprint: str | None = None,
        timeout: float = 0.05,
        patience: float = 2.0,
    ) -> None:
        require(0 < timeout <= patience, "timeout", timeout, f"up to {patience:g} s", DataError)
        self._lock_step, self._timeout, self._patience = lock_step, timeout, patience
        self._sequence = int.from_bytes(os.urandom(4), "little")  # not that of an earlier program
        self._model, self._every, self._driving, self._begun = bytes(4), 0, False, b""
        self._samples, self.statistics = deque[State](maxlen=100_000), Statistics()
        self._port = open_port(port, baud) if isinstance(port, str | Path) else port
        try:
            self.device = device = self._identified()
            if fingerprint is not None and fingerprint.lower() != device.fingerprint:
                problem = f"the device has model {device.fingerprint}, not {fingerprint:.40}"
                remedy = "load the program exported with that model"
                raise LinkError(problem, parameter="fingerprint", remedy=remedy)
            self._model, longest = bytes.fromhex(device.fingerprint)[:4], device.silence
            self._kind = np.dtype(device.numbers).newbyteorder("<")
            self._silence = longest if watchdog is None else round(watchdog / device.period)
            allowed = f"{device.period:g} to {device.period * longest:g} s"
            require(1 <= self._silence <= longest, "watchdog", watchdog, allowed, DataError)
        except BaseException:
            self._port.close()
            raise

    def step(self, inputs: Inputs) -> State:
        """Step the model by one sample, in lock-step, and return its state.

        ``inputs`` are those of ``device.inputs``, by name or in their order, within their limits; NaN
        where one may be missing.
        """
        return self._drive(inputs, lock_step=True)

    def set(self, inputs: Inputs) -> State:
        """Set the inputs of the coming steps of the device's timer, before the watchdog acts."""
        return self._drive(inputs, lock_step=False)

    def _drive(self, inputs: Inputs, *, lock_step: bool) -> State:
        if lock_step != self._lock_step:
            method = "step()" if self._lock_step else "set()"
            raise LinkError(f"lock_step is {self._lock_step}", remedy=f"call {method}")
        ports, values = self.device.inputs, np.empty(0)
        names, row = [port.name for port in ports], inputs
        with suppress(KeyError, TypeError, ValueError):
            if isinstance(inputs, Mapping) and inputs.keys() <= {*names}:
                row = [inputs[name] for name in names]
            values = np.asarray(row, dtype=np.float64).ravel().astype(self._kind)
        if values.size != len(ports):
            remedy = f"give numbers for {', '.join(names)}"
            raise DataError(f"{inputs!r:.100} cannot be set", remedy=remedy)
        n_required = len(ports) - self.device.n_missable
        for port, value in zip(ports[:n_required], values[:n_required].tolist(), strict=True):
            if not port.low <= value <= port.high:  # as NaN never is
                problem = f"{value:g} {port.unit} is beyond {port.low:g} to {port.high:g}"
                remedy = "stay within, or export the model with other limits"
                raise DataError(problem, channel=port.name, remedy=remedy)
        settings = struct.pack("<BHI", lock_step, self._every, self._silence)
        state = self._state(self._ask(Kind.INPUTS, settings + values.tobytes()))
        self.statistics.resumed += self._driving and Note.RESUMED in state.notes
        self._driving = True
        return state

    def stream(self, every: int) -> None:
        """From the next inputs on, have the device send every so many of its steps, or none with 0."""
        require(0 <= every <= WORD, "every", every, "0 to 65535", DataError)
        self._every = every

    def samples(self, timeout: float = 0.0) -> list[State]:
        """Return the steps that were received since the last call, waiting for the first one [s]."""
        until = time.monotonic() + timeout
        self._take(0.0)
        while not self._samples and (remaining := until - time.monotonic()) > 0:
            self._take(remaining)
        return [self._samples.popleft() for _ in range(len(self._samples))]

    def reset(self) -> State:
        """Clear the model's memory: the next step is its first."""
        return self._state(self._ask(Kind.RESET))

    def release(self) -> State:
        """Make the outputs the safe ones, until the next inputs."""
        self._driving = False
        return self._state(self._ask(Kind.RELEASE))

    def state(self) -> State:
        """Return the state; this changes nothing, not even the watchdog's time."""
        return self._state(self._ask(Kind.STATE))

    def memory(self) -> Array:
        """Return the memory of the model, in the order of its C; see `mckibben.exporting.state_of`."""
        n, most, body = self.device.n_memory, (ROOM - 1) // self._kind.itemsize, b""
        for first in range(0, n, most):
            body += self._ask(Kind.READ, struct.pack("<HB", first, min(most, n - first)))
        return self._numbers(body, n)

    def close(self) -> None:
        """Make the outputs the safe ones if this link has driven them, and close the port."""
        try:
            if self._driving:
                with suppress(DataError):  # else the watchdog does it
                    self.release()
        finally:
            self._port.close()

    def __exit__(self, *error: object) -> None:
        self.close()

    def _identified(self) -> Device:
        text = b""
        while len(text) <= WORD and (
            part := self._ask(Kind.IDENTIFY, struct.pack("<H", len(text)))
        ):
            text += part
        try:
            return TypeAdapter(Device).validate_json(text)
        except ValidationError:
            raise unreadable_answer() from None

    def _ask(self, kind: Kind, body: bytes = b"") -> bytes:
        """Send a frame until it is answered, and return the answer, without its status."""
        self._sequence = (self._sequence + 1) % WORDS
        packed = Frame(kind, self._model, self._sequence, body).packed()
        started, answer, sent = time.monotonic(), None, 0
        while answer is None:
            last_sent = time.monotonic()
            if last_sent - started >= self._patience:
                problem = f"nothing has answered for {self._patience:g} s"
                remedy = "check power, port, rate, and other users of it"
                raise LinkError(problem, parameter="patience", remedy=remedy)
            with port_errors():
                self._port.write(b"\0" + packed if sent else packed)  # a zero ends noise
            sent += 1
            while (
                answer is None and (remaining := last_sent + self._timeout - time.monotonic()) > 0
            ):
                answer = self._take(remaining, kind)
        self.statistics.repeated += sent - 1
        if not answer or answer[0] >= len(STATUSES):
            raise unreadable_answer()
        if answer[0]:
            problem = f"the device refuses {kind.name}: {STATUSES[answer[0]]}"
            error = LinkError(problem, remedy="see docs/deploy/link.md, or open the link again")
            error.status = answer[0]
            raise error
        return answer[1:]

    def _take(self, timeout: float, kind: Kind | None = None) -> bytes | None:
        """Read once, store samples, and return the body of the expected answer if it has come."""
        with port_errors():
            self._port.timeout = max(timeout, 0.0)
            received = self._port.read(max(self._port.in_waiting, 1))
        *pieces, rest = (self._begun + received).split(b"\0")
        self._begun, body = rest[: PAYLOAD + 2], None  # more is no frame
        for piece in filter(None, pieces):
            frame = unpacked(piece)
            if frame and kind and frame[::2] == (kind | ANSWER, self._sequence):
                body = frame.body
            elif frame and frame[:2] == (Kind.SAMPLE | ANSWER, self._model) and self._driving:
                self._samples.append(self._state(frame.body[1:]))
            else:
                self.statistics.dropped += 1
        return body

    def _state(self, body: bytes) -> State:
        if len(body) < 5:
            raise unreadable_answer()
        n = len(self.device.outputs)
        notes, steps = struct.unpack_from("<BI", body)
        numbers = self._numbers(body[5:], n + len(self.device.inputs))
        if not np.isfinite(numbers[:n]).all():
            raise unreadable_answer()
        return State(Note(notes), steps, numbers[:n], numbers[n:], time.monotonic())

    def _numbers(self, body: bytes, n: int) -> Array:
        if len(body) != n * self._kind.itemsize:
            raise unreadable_answer()
        with np.errstate(invalid="ignore"):  # of a NaN that signals
            return np.frombuffer(body, self._kind).astype(np.float64)


def open_port(name: str | Path, baud: int) -> Serial:
    """Return a serial port, open for this program alone."""
    demand("serial", "serial", "serial ports")
    from serial import Serial

    try:
        return Serial(str(name), baud, write_timeout=1.0, exclusive=True)
    except (OSError, ValueError) as error:
        remedy = "give an unused serial port that you may read and write, and one of its rates"
        raise DataError(f"it cannot be opened ({error})", file=name, remedy=remedy) from None


@contextmanager
def port_errors() -> Iterator[None]:
    """Turn errors of a port into `LinkError`."""
    try:
        yield
    except OSError as error:
        remedy = "see that the device is on and plugged in, and open the link again"
        raise LinkError(f"the serial port has failed ({error})", remedy=remedy) from None


def unreadable_answer() -> LinkError:
    """Return the error of an answer that does not belong to the protocol."""
    return LinkError("the device's answer cannot be read", remedy="export it by this release again")
