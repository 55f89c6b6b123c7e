"""A line in memory between a client and a server, with a clock of its own, which does to what passes
what it is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tests.link.serving import SAMPLE_TIME, Compiled
from tests.link.twin import Twin

FAULTS = (
    *("pass", "lose", "flip", "twice", "hold", "cut", "join", "noise"),
    *("switch off in it", "silence"),
)


class Line:
    """Carries pieces, each as the next of the faults says; all pass when those have ended."""

    def __init__(self, server: Twin | Compiled, faults: Iterator[tuple[str, int]]) -> None:
        self.server, self._faults = server, faults
        self.time = 0.0
        self._coming = b""
        self._held: dict[Callable[[bytes], None], list[bytes]] = {}
        self._ticked = 0

    def clock(self) -> float:
        return self.time

    def write(self, data: bytes) -> None:
        self._carry(data, self._to_server)

    def read(self, timeout: float) -> bytes:
        self._pass_time(1e-4)
        self._from_server()
        until = self.time + timeout
        while not self._coming and self.time < until:
            self._pass_time(min(SAMPLE_TIME, until - self.time + 1e-9))
            self._from_server()
        came, self._coming = self._coming, b""
        return came

    def close(self) -> None:
        pass

    def _pass_time(self, seconds: float) -> None:
        self.time += seconds
        while (self._ticked + 1) * SAMPLE_TIME <= self.time:
            self._ticked += 1
            self.server.tick()

    def _to_server(self, data: bytes) -> None:
        for byte in data:
            self.server.receive(byte)

    def _to_host(self, data: bytes) -> None:
        self._coming += data

    def _from_server(self) -> None:
        sent = b""
        while (byte := self.server.send()) >= 0:
            sent += bytes([byte])
            if byte == 0:
                self._carry(sent, self._to_host)
                sent = b""

    def _carry(self, data: bytes, onward: Callable[[bytes], None]) -> None:
        fault, number = next(self._faults, ("pass", 0))
        held = self._held.setdefault(onward, [])
        place = number % len(data)
        if fault == "lose":
            return
        if fault == "flip":
            data = bytes([*data[:place], data[place] ^ (1 << number % 8), *data[place + 1 :]])
        elif fault == "hold":
            held.append(data)
            return
        elif fault == "cut":
            data = data[:place]
        elif fault == "join":
            data = data.rstrip(b"\0")
        elif fault == "noise":
            data = data[:place] + number.to_bytes(4, "little") + data[place:]
        elif fault == "switch off in it":
            onward(data[:place])
            self.server.switch_on()
            data = data[place:]
        elif fault == "silence":
            self._pass_time(0.002 * (number % 100))
        onward(data)
        if fault == "twice":
            onward(data)
        if held and number % 2:  # what was held comes late, the latest first
            onward(held.pop())
