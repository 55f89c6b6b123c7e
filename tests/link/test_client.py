"""Whatever a line does: nothing wrong is applied, the watchdog acts, and the link comes back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.errors import DataError
from mckibben.link import Link, LinkError
from tests.link.serving import SAMPLE_TIME, SERVING, Compiled, block, twin
from tests.link.twin import Twin
from tests.tools import needs

FAULTS = ("pass", "lose", "flip", "twice", "hold", "cut", "noise", "switch off in it", "silence")


class Line:
    """A line in memory with a clock of its own; pieces pass, or go as the next of the faults says."""

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


INPUTS = np.cumsum(np.sin(np.arange(400) / 7.0) + 0.2 * np.sin(np.arange(400) / 3.1))
INPUTS = 0.1 + 5.8 * (INPUTS - INPUTS.min()) / np.ptp(INPUTS) + 1e-6 * np.arange(400)
"""Each of them is another number."""

FAULTY = st.lists(st.tuples(st.sampled_from(FAULTS), st.integers(0, 2**32 - 1)), max_size=60)


def linked(server: Twin | Compiled, faults: list[tuple[str, int]], **settings: object) -> Link:
    line = Line(server, iter(faults))
    given = {"lock_step": True, "patience": 3.0, **settings}
    return Link(line, clock=line.clock, **given)  # type: ignore[arg-type]


def stepped(link: Link, inputs: np.ndarray) -> list[float | None]:
    """Return outputs, None where a step was given up."""
    outputs: list[float | None] = []
    for value in inputs:
        try:
            outputs.append(float(link.step([value]).outputs[0]))
        except LinkError:
            outputs.append(None)
    return outputs


def expected(inputs: np.ndarray) -> np.ndarray:
    return np.clip(block().simulate(inputs), *SERVING.limits["displacement"])


@pytest.mark.parametrize("server", [twin, pytest.param(Compiled, marks=needs("cc"))])
def test_over_a_good_line_the_device_is_the_model(
    server: Callable[[], Twin | Compiled], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames are counted from anywhere, and beyond the last number from 0 again."""
    monkeypatch.setattr("os.urandom", lambda n: b"\xf0" + b"\xff" * (n - 1))
    with linked(server(), []) as link:
        assert stepped(link, INPUTS) == expected(INPUTS).tolist()
        assert link.statistics.repeated == link.statistics.dropped == 0
        assert link.counts().steps == len(INPUTS)


@settings(max_examples=80)
@given(FAULTY)
def test_each_input_is_applied_once_in_order_or_not_at_all(faults: list[tuple[str, int]]) -> None:
    server = twin()
    try:
        link = linked(server, [("pass", 0)] * 6 + faults)
    except LinkError:
        assert not server.applied
        return
    stepped(link, INPUTS[:40])
    for boot in range(server.boots + 1):
        applied = [value for when, (value,) in server.applied if when == boot]
        places = [int(np.flatnonzero(value == INPUTS)[0]) for value in applied]
        assert places == sorted(set(places))
    # the faults have ended by now: the link has come back
    link.reset()
    assert stepped(link, INPUTS[:20]) == expected(INPUTS[:20]).tolist()


@settings(max_examples=100)
@given(FAULTY)
def test_where_the_device_stays_on_outputs_are_those_of_the_model(
    faults: list[tuple[str, int]],
) -> None:
    """Loss, noise, doubling, and frames that come late change nothing but the time it takes."""
    kept = [fault for fault in faults if fault[0] not in ("switch off in it", "silence")]
    server = twin(replace(SERVING, watchdog=10.0))
    link = linked(server, [("pass", 0)] * 8 + kept, timeout=0.02, patience=30.0)
    assert stepped(link, INPUTS[:60]) == expected(INPUTS[:60]).tolist()
    assert [value for _, (value,) in server.applied] == INPUTS[:60].tolist()


def test_a_silent_host_leaves_the_safe_outputs() -> None:
    server = twin()
    line = Line(server, iter([]))
    link = Link(line, lock_step=True, clock=line.clock)
    (before,) = link.step([5.0]).outputs
    ticks = 0
    while server.outputs[0] == before:
        server.tick()
        ticks += 1
    assert ticks == SERVING.watchdog / SAMPLE_TIME + 1
    assert server.outputs[0] == SERVING.safe["displacement"]
    assert link.state().is_safe
    assert not link.step([5.0]).is_safe
    assert link.statistics.reopened == 1


def test_the_devices_own_timer_steps_where_the_host_does_not() -> None:
    server = twin()
    line = Line(server, iter([]))
    link = Link(line, clock=line.clock)
    link.set([1.0])
    link.stream(2)
    link.samples()
    steps = link.state().steps
    for _ in range(8):
        server.tick()
        found = link.samples(timeout=1e-6)
        assert len(found) <= 1
        link.keep()
    assert link.state().steps >= steps + 8
    with pytest.raises(LinkError, match=r"set\(\)"):
        link.step([1.0])


def test_what_is_beyond_limits_is_not_sent() -> None:
    server = twin()
    link = linked(server, [])
    for wrong in ([6.1], [float("nan")], [1.0, 2.0], ["x"]):
        with pytest.raises(DataError):
            link.step(wrong)
    assert not server.applied


def test_another_model_is_not_led() -> None:
    with pytest.raises(LinkError, match=r"0123456789abcdef.*fedcba9876543210"):
        linked(twin(), [], fingerprint="fedcba9876543210")
    server = twin()
    link = linked(server, [])
    server.fingerprint = bytes(8)
    server.switch_on()
    with pytest.raises(LinkError, match="0000000000000000"):
        link.step([1.0])
    assert not server.applied
