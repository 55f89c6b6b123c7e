"""The C server, compiled and called from Python, and a serial line to it that fails as it is told."""

from __future__ import annotations

import ctypes
import json
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

from mckibben import PI
from mckibben.blocks.base import Block
from mckibben.exporting import Serving
from mckibben.exporting.c.project import export_c
from mckibben.exporting.programs import compile_c

SAMPLE_TIME = 0.01
SERVING = Serving(
    limits={"pressure": (0.0, 6.0), "displacement": (-20.0, 40.0)},
    safe={"displacement": 0.5},
    watchdog=0.05,
)
SHIM = """
#include "model_server.h"

static model_server server;

void server_init(void);
void server_receive(int byte);
int server_send(void);
void server_tick(void);
void server_count(uint32_t steps);
uint32_t server_steps(void);
double server_input(void);
double server_output(void);

void server_init(void) { model_server_init(&server); }
void server_receive(int byte) { mck_server_receive(&server.link, (uint8_t)byte); }
int server_send(void) { return mck_server_send(&server.link); }
void server_tick(void) { mck_server_tick(&server.link); }
void server_count(uint32_t steps) { server.link.steps = steps; }
uint32_t server_steps(void) { return server.link.steps; }
double server_input(void) { return (double)server.in[0]; }
double server_output(void) { return (double)server.out[0]; }
"""


def block() -> Block:
    """Return a model whose numbers are the same to the last bit in any order of operations."""
    return PI(thresholds=(0.7,), weights=(2.9,), initial="virgin")


@cache
def exported(watchdog: float) -> tuple[str, ctypes.CDLL]:
    """Return the fingerprint and the compiled server."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "c"
        serving = replace(SERVING, watchdog=watchdog)
        export_c(block(), folder, sample_time=SAMPLE_TIME, serving=serving)
        shim, library = Path(place) / "shim.c", Path(place) / "server.so"
        shim.write_text(SHIM)
        sources = [*sorted((folder / "src").glob("*.c")), shim]
        compile_c(sources, library, options=[f"-I{folder / 'src'}", "-shared", "-fPIC"])
        loaded = ctypes.CDLL(str(library))
        loaded.server_output.restype = loaded.server_input.restype = ctypes.c_double
        loaded.server_steps.restype = ctypes.c_uint32
        return str(json.loads((folder / "link.json").read_text())["fingerprint"]), loaded


class Line:
    """A port in memory with a clock of its own; pieces pass, or go as the next of the faults says.

    There is one server, so have one line at a time. ``applied`` are the inputs of each of its steps,
    with how often it was switched on before.
    """

    def __init__(
        self, faults: Iterable[tuple[str, int]] = (), watchdog: float = SERVING.watchdog
    ) -> None:
        self.fingerprint, self.server = exported(watchdog)
        self.faults, self.time, self.timeout = iter(faults), 0.0, 0.0
        self.boots, self.ticked, self._coming = -1, 0, b""
        self.applied: list[tuple[int, float]] = []
        self.switch_on()

    def switch_on(self) -> None:
        self.boots += 1
        self.server.server_init()

    def monotonic(self) -> float:
        return self.time

    @property
    def in_waiting(self) -> int:
        self._from_server()
        return len(self._coming)

    def write(self, data: bytes) -> None:
        self._carry(data, self._to_server)

    def read(self, size: int) -> bytes:
        self.wait(1e-4)
        self._from_server()
        until = self.time + self.timeout
        while not self._coming and self.time < until:
            self.wait(min(SAMPLE_TIME, until - self.time + 1e-9))
            self._from_server()
        came, self._coming = self._coming[:size], self._coming[size:]
        return came

    def close(self) -> None:
        pass

    def wait(self, seconds: float) -> None:
        self.time += seconds
        while (self.ticked + 1) * SAMPLE_TIME <= self.time:
            self.ticked += 1
            self._stepping(self.server.server_tick)

    def _stepping(self, call: Callable[..., None], *given: int) -> None:
        before = self.server.server_steps()
        call(*given)
        if self.server.server_steps() != before:
            self.applied.append((self.boots, self.server.server_input()))

    def _to_server(self, data: bytes) -> None:
        for byte in data:
            self._stepping(self.server.server_receive, byte)

    def _to_host(self, data: bytes) -> None:
        self._coming += data

    def _from_server(self) -> None:
        sent = b""
        while (byte := self.server.server_send()) >= 0:
            sent += bytes([byte])
            if byte == 0:
                self._carry(sent, self._to_host)
                sent = b""

    def _carry(self, data: bytes, onward: Callable[[bytes], None]) -> None:
        fault, number = next(self.faults, ("pass", 0))
        place = number % len(data)
        if fault == "flip":
            data = bytes([*data[:place], data[place] ^ (1 << number % 8), *data[place + 1 :]])
        elif fault == "cut":
            data = data[:place]
        elif fault == "cut out":
            data = data[:place] + data[place + 1 :]
        elif fault == "noise":
            data = data[:place] + number.to_bytes(4, "little") + data[place:]
        elif fault == "switch off in it":
            onward(data[:place])
            self.switch_on()
            data = data[place:]
        elif fault == "silence":
            self.wait(0.002 * (number % 100))
        if fault != "lose":
            onward(data)
        if fault == "twice":
            onward(data)
