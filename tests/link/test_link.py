"""Whatever a line does: nothing wrong is applied, the watchdog acts, and the link goes on."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.errors import DataError
from mckibben.link import Link, LinkError, Note, State
from mckibben.link.client import STATUSES, Frame, Kind, unpacked, unreadable_answer
from tests.link.serving import SAMPLE_TIME, SERVING, Line, block
from tests.refusals import refused
from tests.tools import needs

pytestmark = needs("cc")
FAULTS = ("pass", "lose", "flip", "twice", "cut", "cut out", "noise", "switch off in it", "silence")
INPUTS = np.cumsum(np.sin(np.arange(400) / 7.0) + 0.2 * np.sin(np.arange(400) / 3.1))
INPUTS = 0.1 + 5.8 * (INPUTS - INPUTS.min()) / np.ptp(INPUTS) + 1e-6 * np.arange(400)
"""Each of them is another number."""

FAULTY = st.lists(st.tuples(st.sampled_from(FAULTS), st.integers(0, 2**32 - 1)), max_size=60)
PLACES = st.lists(st.integers(0, 10**6), min_size=1, max_size=3, unique=True)


@contextmanager
def linked(line: Line, **options: Any) -> Iterator[Link]:
    with patch("mckibben.link.client.time", line):
        yield Link(cast(Any, line), **({"lock_step": True, "patience": 3.0} | options))


def stepped(link: Link, inputs: np.ndarray) -> list[float | None]:
    """Return outputs, None where a step was given up."""
    outputs: list[float | None] = []
    for value in inputs:
        try:
            outputs.append(float(link.step([value]).outputs[0]))
        except LinkError:
            outputs.append(None)
    return outputs


def expected(inputs: np.ndarray) -> list[float]:
    return list(np.clip(block().simulate(inputs), *SERVING.limits["displacement"]))


def test_over_a_good_line_the_device_is_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames are counted from anywhere, and beyond the last number from 0 again."""
    monkeypatch.setattr("os.urandom", lambda n: b"\xf0" + b"\xff" * (n - 1))
    with linked(line := Line(), fingerprint=Line().fingerprint) as link:
        line.server.server_count(2**32 - 100)
        assert stepped(link, INPUTS) == expected(INPUTS)
        assert link.statistics.repeated == link.statistics.dropped == link.statistics.resumed == 0
        assert link.state().steps == len(INPUTS) - 100
        (port,) = link.device.outputs
        assert (port.name, port.unit, port.low, port.safe) == ("displacement", "mm", -20.0, 0.5)


@settings(max_examples=80)
@given(FAULTY)
def test_each_input_is_applied_once_in_order_or_not_at_all(faults: list[tuple[str, int]]) -> None:
    line = Line([("pass", 0)] * 8 + faults)
    with linked(line) as link:
        stepped(link, INPUTS[:40])
        for boot in range(line.boots + 1):
            applied = [value for when, value in line.applied if when == boot]
            places = [int(np.flatnonzero(value == INPUTS)[0]) for value in applied]
            assert places == sorted(set(places))
        # the faults have ended by now: the link goes on
        line.faults = iter(())
        link.reset()
        assert stepped(link, INPUTS[:20]) == expected(INPUTS[:20])


@settings(max_examples=80)
@given(FAULTY)
def test_where_the_device_stays_on_outputs_are_those_of_the_model(
    faults: list[tuple[str, int]],
) -> None:
    """Loss, noise and doubling change nothing but the time it takes."""
    given = [fault for fault in faults if fault[0] != "switch off in it"]
    line = Line([("pass", 0)] * 8 + given, watchdog=10.0)
    with linked(line, timeout=0.02, patience=30.0) as link:
        assert stepped(link, INPUTS[:60]) == expected(INPUTS[:60])
        assert [value for _, value in line.applied] == INPUTS[:60].tolist()


@settings(max_examples=80)
@given(st.lists(st.tuples(st.integers(0, 9), st.binary(max_size=40), st.booleans()), max_size=30))
def test_no_frame_leads_beyond_limits(frames: list[tuple[int, bytes, bool]]) -> None:
    line, (low, high) = Line(), SERVING.limits["displacement"]
    for sequence, (kind, body, is_ours) in enumerate(frames, start=1):
        model = bytes.fromhex(line.fingerprint)[:4] if is_ours else body[:4].ljust(4)
        line.write(Frame(kind, model, sequence, body).packed() + body)
        line.wait(0.02)
        assert low <= line.server.server_output() <= high
        assert 0.0 <= line.server.server_input() <= 6.0
        line.read(10_000)
    assert not line.applied or any(kind == Kind.INPUTS for kind, _, _ in frames)


@given(st.binary(max_size=236), st.one_of(st.just([]), PLACES))
def test_frames_are_those_that_were_sent_or_none(body: bytes, places: list[int]) -> None:
    frame = Frame(4, b"abcd", 9, body)
    wire = bytearray(frame.packed()[:-1])
    assert b"\0" not in wire
    for place in places:
        wire[place // 8 % len(wire)] ^= 1 << place % 8
    changed = bytes(wire) != frame.packed()[:-1]
    assert all(unpacked(piece) is None for piece in bytes(wire).split(b"\0")) is changed
    if not changed:
        assert unpacked(bytes(wire)) == frame


def test_a_silent_host_leaves_the_safe_outputs() -> None:
    with linked(line := Line()) as link:
        (before,) = link.step([5.0]).outputs
        ticks = 0
        while line.server.server_output() == before:
            line.server.server_tick()
            ticks += 1
        assert ticks == SERVING.watchdog / SAMPLE_TIME + 1
        state = link.state()
        assert state.is_safe
        assert Note.TRIPPED in state.notes
        assert state.outputs == [SERVING.safe["displacement"]]
        assert not link.step([5.0]).is_safe
        assert link.statistics.resumed == 1
        assert link.release().is_safe
        link.step([5.0])
        assert link.statistics.resumed == 1  # as it was meant
    with refused(DataError, parameter="watchdog"), linked(Line(), watchdog=1.0):
        pass


def test_the_devices_own_timer_goes_on_after_a_reset() -> None:
    with linked(line := Line(), lock_step=False) as link:
        link.stream(2)
        link.set([1.0])
        found: list[State] = []
        for k in range(100):
            link.set([1.0 + 0.01 * k])
            found += link.samples(timeout=0.04)
            if k == 50:
                line.switch_on()
                line.wait(0.5)
                assert link.state().is_safe
        assert link.statistics.resumed == 1
        with refused(LinkError, names="lock_step"):
            link.step([1.0])
        assert found[-1].inputs == pytest.approx([1.99])


class Impostor:
    """A port whose device answers everything with the next of some texts."""

    timeout, in_waiting = 0.0, 0

    def __init__(self, *texts: bytes) -> None:
        self.texts, self.asked = iter(texts), b""

    def write(self, data: bytes) -> None:
        self.asked = data

    def read(self, size: int) -> bytes:
        if (frame := unpacked(self.asked.strip(b"\0"))) is None:
            return b""
        body = b"\0" + next(self.texts, b"")
        return frame._replace(kind=frame.kind | 128, body=body).packed()

    def close(self) -> None:
        pass


ABOUT: dict[str, Any] = {
    "fingerprint": "0123456789abcdef",
    "period": 0.01,
    "silence": 5,
    "numbers": "float64",
    "n_memory": 0,
    "n_missable": 0,
    "inputs": [],
    "outputs": [{"name": "p", "unit": "bar", "low": 0, "high": 6, "safe": 0}],
}
LIES: tuple[dict[str, Any], ...] = (
    *({"fingerprint": "../../x"}, {"period": 0}, {"period": "x"}, {"silence": 2**32}),
    *({"numbers": "object"}, {"n_memory": 2**40}, {"n_missable": -1}, {"outputs": [{}]}),
)


def test_what_a_device_answers_is_not_trusted() -> None:
    texts = [json.dumps(ABOUT | lie).encode() for lie in LIES]
    for text in (b"", b"{}", b"[", *texts):
        with refused(LinkError, problem=unreadable_answer().problem):
            Link(cast(Any, Impostor(text)), timeout=0.5)
    with refused(LinkError, problem=unreadable_answer().problem):
        Link(cast(Any, Impostor(*[b" " * 200] * 400)))
    for outputs, is_good in (((3.0,), True), ((np.nan,), False), ((1.0, 2.0), False), ((), False)):
        body = struct.pack(f"<BI{len(outputs)}d", 1, 7, *outputs)
        link = Link(cast(Any, Impostor(json.dumps(ABOUT).encode(), b"", body)))
        if is_good:
            assert link.state().outputs == [3.0]
        else:
            with refused(LinkError, problem=unreadable_answer().problem):
                link.state()


@given(st.permutations(["pressure", "length", "force"]))
def test_inputs_by_name_are_sent_in_the_order_of_the_device(names: list[str]) -> None:
    ports = [
        {"name": name, "unit": "", "low": 0, "high": 9, "safe": 0}
        for name in ("force", "length", "pressure")
    ]
    state = struct.pack("<BI4d", 1, 7, *range(4))
    about = json.dumps(ABOUT | {"inputs": ports}).encode()
    parts = [about[k : k + 200] for k in range(0, len(about), 200)]
    impostor = Impostor(*parts, b"", state, state)
    link, bodies = Link(cast(Any, impostor), lock_step=True), []
    for inputs in ([1.0, 2.0, 3.0], {name: float(" flp".index(name[0])) for name in names}):
        link.step(inputs)
        frame = unpacked(impostor.asked.strip(b"\0"))
        assert frame is not None
        bodies.append(frame.body)
    assert bodies[0] == bodies[1]


def test_what_is_beyond_limits_is_not_sent() -> None:
    with linked(line := Line()) as link:
        (name,) = (port.name for port in link.device.inputs)
        twice = {name: 1.0, "other": 2.0}
        for wrong in ([6.1], [float("nan")], [1.0, 2.0], ["x"], {name: 6.1}, {"other": 1.0}, twice):
            with pytest.raises(DataError):
                link.step(wrong)
        assert not line.applied
        link.step({name: 1.0})
        assert line.applied


def test_another_model_is_not_driven() -> None:
    other = refused(LinkError, parameter="fingerprint", names="fedcba9876543210")
    with other, linked(Line(), fingerprint="fedcba9876543210"):
        pass
    with linked(line := Line()) as link:
        link._model = b"abcd"  # what it was before the device was programmed anew
        with refused(LinkError, status=STATUSES.index("another model is there"), names="INPUTS"):
            link.step([1.0])
        assert not line.applied
