"""Whatever a line does: nothing wrong is applied, the watchdog acts, and the link comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.errors import DataError
from mckibben.export.c.adjusting import coefficient_limits
from mckibben.export.c.wiring import Wiring
from mckibben.link import Link, LinkError
from mckibben.link.framing import Frame, Reader
from tests.link.lines import FAULTS, Line
from tests.link.serving import SAMPLE_TIME, SERVING, Compiled, block, twin
from tests.link.twin import Twin
from tests.tools import needs

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
    link.close()
    assert server.outputs[0] == SERVING.safe["displacement"]


def test_a_host_may_refuse_to_lead_again() -> None:
    server = twin()
    link = linked(server, [], reopen=False, watchdog=0.02)
    link.step([5.0])
    for _ in range(3):
        server.tick()
    with pytest.raises(LinkError):
        link.step([5.0])


def test_noise_feeds_no_watchdog_and_refused_inputs_neither() -> None:
    server = twin()
    link = linked(server, [])
    link.step([5.0])
    device = link.device
    for number in range(10):
        body = device.packed(np.array([6.5]))
        frame = Frame(4, server.session, server.sequence + 1, body)
        for byte in frame.packed() + bytes([number, 0]):
            server.receive(byte)
        while server.send() >= 0:
            pass
        server.tick()
    assert server.tripped
    assert [value for _, (value,) in server.applied] == [5.0]


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


def test_coefficients_move_within_limits_and_all_at_once() -> None:
    server = twin()
    link = linked(server, [])
    own = link.coefficients()
    np.testing.assert_array_equal(own, block().c_numbers(None))
    _, more = coefficient_limits(Wiring(block(), None), SERVING.adjustable)
    assert (more != own).any()
    link.load_coefficients(more)
    np.testing.assert_array_equal(link.coefficients(), more)
    for wrong in ([*own[:-1], 2 * own[-1]], own[:-1]):
        with pytest.raises(LinkError):
            link.load_coefficients(np.array(wrong))
    np.testing.assert_array_equal(link.coefficients(), more)
    server.switch_on()  # which loses what was loaded: such a device is led no more
    with pytest.raises(LinkError):
        link.step([1.0])
    assert not server.applied


def test_memory_is_carried_to_another_device() -> None:
    one, other = (linked(twin(), []) for _ in range(2))
    stepped(one, INPUTS[:100])
    other.load_memory(one.memory())
    assert stepped(other, INPUTS[100:]) == expected(INPUTS)[100:].tolist()


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


class Babbler:
    """Answers what it likes."""

    def __init__(self, answers: list[bytes]) -> None:
        self.time, self._answers, self._reader, self._coming = 0.0, answers, Reader(), b""

    def write(self, data: bytes) -> None:
        for frame in self._reader.feed(data):
            body = self._answers.pop() if self._answers else b""
            answer = Frame(frame.kind | 128, frame.session, frame.sequence, body)
            self._coming += answer.packed()

    def read(self, timeout: float) -> bytes:
        self.time += timeout + 1e-3
        came, self._coming = self._coming, b""
        return came

    def close(self) -> None:
        pass


@settings(max_examples=100)
@given(st.lists(st.binary(max_size=60).map(lambda body: b"\0" + body), max_size=8))
def test_a_device_that_talks_nonsense_or_nothing_is_an_error(answers: list[bytes]) -> None:
    identity = Line(server := twin(), iter([]))
    identity.write(Frame(1, 0, 1).packed())
    (frame,) = Reader().feed(identity.read(0.0))
    assert server.fingerprint in frame.body
    babbler = Babbler([*answers, frame.body])
    with pytest.raises(DataError):
        Link(babbler, clock=lambda: babbler.time, lock_step=True).step([1.0])
    with pytest.raises(LinkError):
        linked(twin(), [("lose", 0)] * 1000)
