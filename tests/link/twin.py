"""The server again, in plain Python: what the C must do, byte by byte."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np

from mckibben.blocks.base import Block
from mckibben.export.c.serving import Serving, limits
from mckibben.link.framing import ROOM, Frame, unpacked, unstuffed

HALF = 1 << 31


@dataclass
class Twin:
    """Serves a primitive without scratch, in double precision, of which nothing can be adjusted."""

    block: Block
    serving: Serving
    sample_time: float
    fingerprint: bytes
    applied: list[tuple[int, list[float]]] = field(default_factory=list)
    """Inputs, with how often the server had been switched on before."""
    boots: int = -1

    def __post_init__(self) -> None:
        self.channels = [*self.block.inputs, *self.block.outputs]
        found = limits(self.block, self.serving)
        self.low, self.high, self.safe = found.low, found.high, found.safe
        self.n_in, self.n_out = len(self.block.inputs), len(self.block.outputs)
        self.most_silence = int(self.serving.watchdog / self.sample_time + 1e-9)
        self.switch_on()

    def switch_on(self) -> None:
        self.boots += 1
        self.session = (self.boots & 0xFFFF) << 16
        self.sequence = self.last_kind = self.last_status = 0
        self.open = self.lock_step = self.tripped = False
        self.silence, self.quiet, self.steps = self.most_silence, 0, 0
        self.since = self.dropped = 0
        self.numbers = [self.block.coefficients(self.sample_time), np.zeros(self.block.n_states)]
        self.started = False
        self.inputs = self.low[: self.n_in].copy()
        self.begun = b""
        self.answer = self.sample = self.sending = b""
        self.make_safe()

    def make_safe(self) -> None:
        self.outputs = self.safe[self.n_in :].copy()
        self.running, self.every, self.notes = False, 0, 0

    def receive(self, byte: int) -> None:
        if byte:
            self.begun += bytes([byte])
            return
        coded, self.begun = self.begun, b""
        if not coded:
            return
        payload = unstuffed(coded) if len(coded) <= 251 else None
        frame = None if payload is None else unpacked(payload)
        if frame is None or frame.kind & 128 or self.answer:
            self.dropped += 1
            return
        self.handle(frame)

    def send(self) -> int:
        if not self.sending:
            self.sending = self.answer or self.sample
            if not self.sending:
                return -1
            self.from_answer = bool(self.answer)
        byte, self.sending = self.sending[0], self.sending[1:]
        if not self.sending:
            if self.from_answer:
                self.answer = b""
            else:
                self.sample = b""
        return byte

    def tick(self) -> None:
        if self.open and not self.tripped:
            self.quiet += 1
            if self.quiet > self.silence:
                self.make_safe()
                self.tripped = True
        if self.running and not self.lock_step:
            self.step()

    def handle(self, frame: Frame) -> None:
        kind, body = frame.kind, frame.body
        if kind in (1, 2, 5, 7):
            self.reply(frame, self.tell(kind, body))
            return
        ahead = (frame.sequence - self.sequence) % (1 << 32)
        known = self.open and frame.session == self.session
        if known and ahead == 0:
            if kind != self.last_kind:
                self.dropped += 1
                return
            status = self.last_status
        elif kind == 3:
            status = self.opened(frame.session, body)
            if status == 0:
                self.sequence, self.last_kind, self.last_status = frame.sequence, kind, 0
                self.quiet = 0
        elif not known:
            status = 1
        elif ahead >= HALF:
            self.dropped += 1
            return
        else:
            self.sequence, self.last_kind = frame.sequence, kind
            status = self.last_status = self.carried_out(kind, body)
            if status == 0:
                self.quiet = 0
        self.reply(frame, bytes([status]) + (self.stand() if kind == 4 else b""))

    def reply(self, frame: Frame, body: bytes) -> None:
        self.answer = Frame(frame.kind | 128, self.session, frame.sequence, body).packed()

    def flags(self) -> int:
        return self.notes | self.running | self.tripped << 1 | self.lock_step << 5

    def stand(self) -> bytes:
        return struct.pack("<BI", self.flags(), self.steps) + self.outputs.tobytes()

    def tell(self, kind: int, body: bytes) -> bytes:
        sizes = [0, len(self.numbers[1])]
        if kind == 1 and not body:
            told = [0, 8, self.flags(), self.fingerprint, round(1e6 * self.sample_time)]
            told += [self.most_silence, self.steps, 0, self.dropped % (1 << 32)]
            numbers = [self.n_in, self.n_out, *sizes, 0]
            return struct.pack("<BBB8sIIIIIHHHHH", *told, *numbers)
        if kind == 5 and not body:
            return b"\0" + self.stand() + self.inputs.tobytes()
        if kind == 2 and len(body) == 1 and body[0] < self.n_in + self.n_out:
            place = body[0]
            name = self.channels[place].name.encode()
            unit = (self.channels[place].unit or "1").encode()
            ends = struct.pack("<3d", self.low[place], self.high[place], self.safe[place])
            return b"\0" + ends + bytes([len(name)]) + name + bytes([len(unit)]) + unit
        if kind == 7 and len(body) == 4 and body[0] < 2:
            what, first, count = struct.unpack("<BHB", body)
            if 8 * count < ROOM and first + count <= sizes[what]:
                return b"\0" + self.numbers[what][first : first + count].tobytes()
        return b"\3"

    def opened(self, session: int, body: bytes) -> int:
        if len(body) != 13 or body[8] > 1:
            return 3
        if body[:8] != self.fingerprint:
            return 5
        if not 0 < (session - self.session) % (1 << 32) < HALF:
            return 6
        (silence,) = struct.unpack("<I", body[9:])
        if not 1 <= silence <= self.most_silence:
            return 2
        self.make_safe()
        self.session, self.silence, self.lock_step = session, silence, bool(body[8])
        self.open, self.tripped = True, False
        return 0

    def carried_out(self, kind: int, body: bytes) -> int:
        if kind in (10, 11, 12):
            if body:
                return 3
            if kind == 12:
                self.make_safe()
                self.open = False
            if kind == 10:
                self.numbers[1][:] = 0
                self.started = False
            return 4 if kind == 11 and self.tripped else 0
        if self.tripped:
            return 4
        if kind == 4:
            return self.take_inputs(body)
        if kind == 6:
            if len(body) != 2:
                return 3
            self.every, self.since = struct.unpack("<H", body)[0], 0
            return 0
        if kind == 8:  # nothing can be adjusted
            return 3 if len(body) < 11 or (len(body) - 3) % 8 or body[0] > 1 else 8
        if kind == 9:
            return 3 if len(body) != 1 or body[0] > 1 else 7
        return 3

    def take_inputs(self, body: bytes) -> int:
        if len(body) != 8 * self.n_in:
            return 3
        values = np.frombuffer(body)
        if not ((self.low[: self.n_in] <= values) & (values <= self.high[: self.n_in])).all():
            return 2
        self.inputs = values
        self.applied.append((self.boots, values.tolist()))
        self.running = True
        if self.lock_step:
            self.step()
        return 0

    def step(self) -> None:
        coefficients, state = self.numbers
        if not self.started:
            state[:] = self.block.initial_state(self.inputs)
            self.started = True
        outputs = np.empty(self.n_out)
        self.block.kernel(coefficients, state, self.inputs, outputs)
        self.outputs = np.clip(outputs, self.low[self.n_in :], self.high[self.n_in :])
        self.notes = 4 * bool((self.outputs != outputs[0]).any())
        self.steps = (self.steps + 1) % (1 << 32)
        self.since = (self.since + 1) % (1 << 16)
        if self.every and self.since >= self.every:
            self.since = 0
            if not self.sample:
                body = b"\0" + self.stand() + self.inputs.tobytes()
                self.sample = Frame(13 | 128, self.session, self.sequence, body).packed()
