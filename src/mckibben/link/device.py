"""What a device says: what it is, its channels and their limits, and how it stands."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.link.framing import ROOM


class Kind(IntEnum):
    """What a frame is for; an answer's has 128 added."""

    IDENTIFY = 1
    DESCRIBE = 2
    OPEN = 3
    INPUTS = 4
    STATE = 5
    STREAM = 6
    READ = 7
    RESET = 8
    KEEP = 9
    RELEASE = 10
    SAMPLE = 11


ANSWER = 128


class Status(IntEnum):
    """What an answer begins with."""

    OK = 0
    NO_SESSION = 1
    BEYOND_LIMITS = 2
    MALFORMED = 3
    IS_SAFE = 4
    OTHER_MODEL = 5
    OLD_SESSION = 6


class Note(IntFlag):
    """How the outputs came about."""

    RUNNING = 1
    TRIPPED = 2
    LIMITED = 4
    BAD_INPUT = 8
    BAD_OUTPUT = 16
    LOCK_STEP = 32


IDENTITY = struct.Struct("<BB8sIIIIHHHH")


@dataclass(frozen=True)
class Port:
    """A channel of a device.

    Parameters
    ----------
    name, unit : str
    low, high : float
        Limits that were fixed at export.
    safe : float
        Of an output: what stands there while no host leads.
    """

    name: str
    unit: str
    low: float
    high: float
    safe: float


@dataclass(frozen=True)
class Device:
    """What a device is, which does not change while it is on.

    Parameters
    ----------
    fingerprint : str
        Of the exported code, 16 hexadecimal digits.
    period : float
        Time between its ticks [s].
    silence : int
        Ticks without a frame after which its watchdog acts, at most.
    kind : dtype
        Of its numbers, float32 or float64.
    n_memory : int
        Numbers of the model's memory that can be read.
    inputs, outputs : tuple of Port
    n_missable : int
        Of the inputs the last, which may be missing.
    """

    fingerprint: str
    period: float
    silence: int
    kind: np.dtype[np.floating]
    n_memory: int
    n_missable: int = 0
    inputs: tuple[Port, ...] = ()
    outputs: tuple[Port, ...] = ()

    @property
    def most(self) -> int:
        """Numbers of a vector that fit into a frame."""
        return (ROOM - 4) // self.kind.itemsize

    def packed(self, values: Array) -> bytes:
        """Return numbers as the device reads them."""
        return values.astype(self.kind).tobytes()

    def numbers(self, body: bytes) -> Array:
        """Return numbers that the device wrote."""
        if len(body) % self.kind.itemsize:
            raise unfit("numbers")
        with np.errstate(invalid="ignore"):  # of a NaN that signals
            return np.frombuffer(body, self.kind).astype(np.float64)


@dataclass(frozen=True)
class State:
    """How a device stands.

    Parameters
    ----------
    notes : Note
        Whether it runs, and what is to be said of the last step.
    steps : int
        Taken since it was switched on, modulo 2^32.
    outputs : array, shape (n_outputs,)
    inputs : array, shape (n_inputs,)
        Of the last step; empty where they were not told.
    """

    notes: Note
    steps: int
    outputs: Array
    inputs: Array

    @property
    def is_safe(self) -> bool:
        """Whether no host leads, and the outputs are the safe ones."""
        return not self.notes & Note.RUNNING


@dataclass(frozen=True)
class Counts:
    """What a device has counted since it was switched on, modulo 2^32."""

    notes: Note
    steps: int
    dropped: int


def identified(body: bytes) -> tuple[Device, Counts, int, int]:
    """Return what an answer to `IDENTIFY` says, and how many inputs and outputs there are."""
    if len(body) != IDENTITY.size:
        raise unfit("an identity")
    size, notes, print_, period, silence, steps, dropped, *sizes = IDENTITY.unpack(body)
    n_in, n_out, n_memory, n_missable = sizes
    if size not in (4, 8) or not period or not silence or not n_out or n_missable > n_in:
        raise unfit("an identity")
    if size * (n_in + n_out) > ROOM:  # which no frame would hold
        raise unfit("an identity")
    kind = np.dtype(f"<f{size}")
    device = Device(print_.hex(), 1e-6 * period, silence, kind, n_memory, n_missable)
    return device, Counts(Note(notes), steps, dropped), n_in, n_out


def described(body: bytes, device: Device) -> Port:
    """Return what an answer to `DESCRIBE` says."""
    size = 3 * device.kind.itemsize
    texts, rest = [], body[size:]
    for _ in range(2):
        n = rest[0] if rest else 0
        texts.append(rest[1 : n + 1].decode("ascii", "replace"))
        if len(rest) < n + 1:
            raise unfit("a channel")
        rest = rest[n + 1 :]
    numbers = device.numbers(body[:size])
    if rest or numbers.size != 3 or not np.isfinite(numbers).all():
        raise unfit("a channel")
    low, high, safe = numbers.tolist()
    name, unit = texts
    return Port(name, "" if unit == "1" else unit, low, high, safe)


def stated(body: bytes, device: Device, *, with_inputs: bool) -> State:
    """Return what the outputs of an answer say."""
    if len(body) < 5:
        raise unfit("outputs")
    notes, steps = struct.unpack_from("<BI", body)
    numbers, n_out = device.numbers(body[5:]), len(device.outputs)
    n = n_out + (len(device.inputs) if with_inputs else 0)
    if numbers.size != n or not np.isfinite(numbers[:n_out]).all():
        raise unfit("outputs")
    return State(Note(notes), steps, numbers[:n_out], numbers[n_out:])


def unfit(what: str) -> DataError:
    """Return the error that a device does not speak as it should."""
    return DataError(
        f"the device gives {what} that cannot be read",
        remedy="see that it was exported by the same release of mckibben",
    )
