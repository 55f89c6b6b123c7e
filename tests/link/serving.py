"""Servers to test: the C, compiled and called from Python, and its twin, of the same export."""

from __future__ import annotations

import ctypes
import json
import tempfile
from functools import cache
from pathlib import Path

from mckibben import PI
from mckibben.blocks.base import Block
from mckibben.export import Serving
from mckibben.export.c.building import compile_c
from mckibben.export.c.project import export_c
from tests.link.twin import Twin

SAMPLE_TIME = 0.01
SERVING = Serving(
    limits={"pressure": (0.0, 6.0), "displacement": (-20.0, 40.0)},
    safe={"displacement": 0.5},
    watchdog=0.05,
)

SHIM = """
#include "model_server.h"

static model_server server;

void server_init(uint32_t start);
void server_receive(int byte);
int server_send(void);
void server_tick(void);
double server_output(void);

void server_init(uint32_t start) { model_server_init(&server, start); }
void server_receive(int byte) { mck_server_receive(&server.link, (uint8_t)byte); }
int server_send(void) { return mck_server_send(&server.link); }
void server_tick(void) { mck_server_tick(&server.link); }
double server_output(void) { return (double)server.out[0]; }
"""


def block() -> Block:
    """Return a model whose numbers are the same to the last bit in any order of operations."""
    return PI(thresholds=(0.7,), weights=(2.9,), initial="virgin")


@cache
def exported() -> tuple[str, ctypes.CDLL]:
    """Return the fingerprint and the compiled server."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "c"
        export_c(block(), folder, sample_time=SAMPLE_TIME, serving=SERVING)
        shim = Path(place) / "shim.c"
        shim.write_text(SHIM)
        library = Path(place) / "server.so"
        sources = [*sorted((folder / "src").glob("*.c")), shim]
        compile_c(sources, library, options=[f"-I{folder / 'src'}", "-shared", "-fPIC"])
        loaded = ctypes.CDLL(str(library))
        loaded.server_output.restype = ctypes.c_double
        return str(json.loads((folder / "link.json").read_text())["fingerprint"]), loaded


class Compiled:
    """The C server; there is one, so have one at a time."""

    def __init__(self) -> None:
        self.fingerprint, self._library = exported()
        self.boots = -1
        self.switch_on()

    def switch_on(self) -> None:
        self.boots += 1
        self._library.server_init(self.boots)

    def receive(self, byte: int) -> None:
        self._library.server_receive(byte)

    def send(self) -> int:
        return int(self._library.server_send())

    def tick(self) -> None:
        self._library.server_tick()

    @property
    def outputs(self) -> list[float]:
        return [float(self._library.server_output())]


def twin(serving: Serving = SERVING) -> Twin:
    return Twin(block(), serving, SAMPLE_TIME, bytes.fromhex("0123456789abcdef"))
