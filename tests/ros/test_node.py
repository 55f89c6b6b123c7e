"""A compensator between topics: the same pressures as its stream, and safe ones when nobody speaks."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, muscles, read
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.errors import DataError, ModelError
from mckibben.ros.kinds import KINDS, Kind

pytest.importorskip("cyclonedds")

from mckibben.ros.messages import message
from mckibben.ros.node import Node, Topic

INVERSE = GPI.example().inverse()
PERIOD, DAY = 0.01, 1_700_000_000_000_000_000


@dataclass
class Line:
    """A topic in memory."""

    kind: Kind
    waiting: list[Any] = field(default_factory=list)
    sent: list[Any] = field(default_factory=list)

    def newest(self) -> Any | None:
        found, self.waiting = self.waiting[-1:], []
        return found[0] if found else None

    def send(self, said: Any) -> None:
        self.sent.append(said)


class Lines:
    """Topics in memory."""

    def __init__(self) -> None:
        self.lines: dict[str, Line] = {}

    def subscribe(self, name: str, kind: Kind) -> Line:
        return self.lines.setdefault(name, Line(kind))

    publish = subscribe

    def say(self, name: str, *values: float) -> None:
        line = self.lines[name]
        line.waiting.append(message(line.kind, list(values), [str(k) for k in values], DAY))


def node(lines: Lines, block: Any = INVERSE, **options: Any) -> Node:
    given = {"reference": Topic("r"), "pressure": Topic("p"), "highest": 1e3, "period": PERIOD}
    return Node(block, lines, **{**given, **options})


def wave(k: int) -> float:
    return float(5.0 + 3.0 * np.sin(0.07 * k))


def run(one: Node, lines: Lines, said: dict[int, tuple[float, ...]], n: int) -> list[list[float]]:
    """Return the pressures of steps, before some of which a reference comes."""
    given = []
    for k in range(n):
        if k in said:
            lines.say("r", *said[k])
        given.append(one.step(PERIOD * k, DAY + round(1e9 * PERIOD) * k))
    return given


@pytest.mark.parametrize(("low", "high"), [(0.0, 1e3), (2.5, 3.0)])
def test_pressures_are_those_of_the_stream_within_limits(low: float, high: float) -> None:
    lines = Lines()
    one = node(lines, lowest=low, highest=high, safe=low)
    given = run(one, lines, {k: (wave(k),) for k in range(200)}, 200)
    stream = INVERSE.stream(PERIOD)
    expected = np.array([stream.step(wave(k)).copy() for k in range(200)])
    assert given == np.clip(expected, low, high).tolist()
    assert [said.data for said in lines.lines["p"].sent] == [pressure for (pressure,) in given]


def test_a_late_reference_is_held_and_silence_is_safe() -> None:
    """Up to the time-out the last good reference stands; then it is safe, and memory stands."""
    lines = Lines()
    one = node(lines, reference=Topic("r", KINDS["Float64MultiArray"]), safe=0.5, timeout=0.105)
    bad = [(np.nan,), (np.inf,), (), (1.0, 2.0)]
    sent: dict[int, tuple[float, ...]] = {k: (wave(k),) for k in [*range(1, 60), *range(100, 150)]}
    given = run(one, lines, sent | {k: bad[k % 4] for k in range(60, 80)}, 150)
    stream = INVERSE.stream(PERIOD)
    held = [stream.step(wave(min(k, 59))).tolist() for k in range(1, 70)]
    assert given[0] == [0.5]
    assert given[1:70] == held
    assert given[70:100] == [[0.5]] * 30
    assert given[100:] == [stream.step(wave(k)).tolist() for k in range(100, 150)]
    assert (one.silences, one.refused) == (1, 20)


def test_a_run_is_recorded_and_its_end_is_safe_whatever_ends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = Lines()
    topics = {"pressure": Topic("p", KINDS["FluidPressure"]), "measured": Topic("displacement")}
    one = node(lines, safe=0.25, record=tmp_path / "run.mcap", **topics)
    given = []

    def full(*_: object) -> None:
        raise OSError(28, "no space left")

    def turns() -> Any:
        for k in range(100):
            lines.say("r", wave(k))
            lines.say("displacement", wave(k) + 0.5)
            given.append(one.step(PERIOD * k, DAY + round(1e9 * PERIOD) * k)[0])
        with monkeypatch.context() as patch:
            patch.setattr("mckibben.ros.recording.Recorder.write", full)
            yield 0

    with pytest.raises(OSError, match="no space left"):
        one.run(turns(), lambda: 1.0, lambda: DAY + 10**9)
    assert lines.lines["p"].sent[-1].fluid_pressure == 0.25e5
    (found,) = read(tmp_path / "run.mcap", units={"displacement": "mm"})
    np.testing.assert_allclose(found["pressure"][:100], given, rtol=1e-12)
    np.testing.assert_array_equal(found["displacement"], [wave(k) + 0.5 for k in range(100)])


def test_what_else_is_asked_for_comes_from_its_topic() -> None:
    """References are the driven inputs, the rest is measured; both must speak."""
    balance = muscles.load("rail").balance
    with pytest.raises(DataError, match="force"):
        node(Lines(), balance)
    lines = Lines()
    one = node(
        lines,
        balance,
        reference=Topic("r", KINDS["JointState"]),
        measured=Topic("m"),
        timeout=0.055,
    )
    stream = balance.stream(PERIOD)
    expected, given = [], []
    for k in range(50):
        metres = 1e-3 * wave(k)
        lines.say("r", metres)
        lines.say("m", 100.0 + k)
        given.append(one.step(PERIOD * k, DAY))
        expected.append(stream.step([metres / 1e-3, 100.0 + k]).tolist())
    assert given == expected
    assert min(given)[0] > 0.0
    for k in range(50, 60):
        lines.say("r", 1e-3 * wave(k))
        last = one.step(PERIOD * k, DAY)
    assert last == [0.0]


@pytest.mark.parametrize(
    "options",
    [
        {"safe": 7.0, "highest": 6.0},
        {"highest": np.nan},
        {"timeout": 0.001},
        {"timeout": np.inf},
        {"pressure": Topic("p", KINDS["JointState"])},
        {"reference": Topic("r", KINDS["FluidPressure"])},
        {"block": GPI.example()},
    ],
)
def test_what_cannot_run_is_refused(options: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises((DataError, ModelError)):
        node(Lines(), record=tmp_path / "run.mcap", **options)
    assert not (tmp_path / "run.mcap").exists()


def test_what_has_been_learnt_outlives_silence_and_is_gone_on_from() -> None:
    block = Adaptive.example()
    lines = Lines()
    one = node(lines, block, measured=Topic("m"), timeout=0.055, lowest=-1e3)
    assert one.state is None
    stream = block.stream(PERIOD)
    for k in [*range(60), *range(100, 160)]:
        lines.say("r", wave(k))
        lines.say("m", 1.1 * wave(k))
        given = one.step(PERIOD * k, DAY)
        assert given == stream.step([wave(k), 1.1 * wave(k)]).tolist()
        if k == 59:
            assert one.step(0.98, DAY) == [0.0]
    assert one.state is not None
    again = block.resumed(one.state).stream(PERIOD)
    given = again.step([wave(160), 1.1 * wave(160)]).tolist()
    assert given == stream.step([wave(160), 1.1 * wave(160)]).tolist()
