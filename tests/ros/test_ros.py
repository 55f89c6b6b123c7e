"""Messages beside rosbags, and a compensator between topics: its stream's pressures, or safe ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import GPI, read
from mckibben.ros.kinds import KINDS, Kind

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rosbags import typesys

from mckibben.ros.messages import CLASSES, message, numbers, serialized
from mckibben.ros.node import Node, Topic

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
INVERSE = GPI.example().inverse()
PERIOD, DAY = 0.01, 1_700_000_000_000_000_000


@dataclass
class Line:
    kind: Kind
    waiting: list[Any] = field(default_factory=list)
    sent: list[Any] = field(default_factory=list)

    def newest(self) -> Any | None:
        found, self.waiting = self.waiting[-1:], []
        return found[0] if found else None

    def send(self, said: Any) -> None:
        self.sent.append(said)


@dataclass
class Lines:
    """Topics in memory."""

    lines: dict[str, Line] = field(default_factory=dict)

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


def run(one: Node, lines: Lines, said: dict[int, tuple[float, ...]]) -> list[list[float]]:
    """Return the pressures of steps, before some of which a reference comes."""
    given = []
    for k in range(150):
        if k in said:
            lines.say("r", *said[k])
        given.append(one.step(PERIOD * k, DAY + round(1e9 * PERIOD) * k))
    return given


@given(
    st.lists(st.floats(allow_nan=False), min_size=1, max_size=5), st.integers(0, 2**31 * 10**9 - 1)
)
def test_bytes_are_those_of_ros(values: list[float], when: int) -> None:
    for kind in KINDS.values():
        ours = values[:1] if kind.single else values
        names = [f"joint_{k}" for k in range(len(ours))]
        data = serialized(message(kind, ours, names, when))
        theirs: Any = STORE.deserialize_cdr(data, kind.ros)
        assert bytes(STORE.serialize_cdr(theirs, kind.ros)) == data
        match kind.name:
            case "FluidPressure":
                assert theirs.fluid_pressure == ours[0]
            case "JointState":
                np.testing.assert_array_equal(theirs.position, ours)
                assert theirs.name == names
            case _:
                np.testing.assert_array_equal(np.atleast_1d(theirs.data), ours)
        if hasattr(theirs, "header"):
            stamp = theirs.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == when
        assert numbers(kind, CLASSES[kind.name].deserialize(data)) == ours
        assert CLASSES[kind.name].__idl_typename__ == kind.dds


def test_units_are_those_of_ros() -> None:
    assert KINDS["FluidPressure"].factor("bar") == 1e5
    assert KINDS["JointState"].factor("mm") == 1e-3
    assert KINDS["Float64"].factor("mm") == 1.0


@pytest.mark.parametrize(("low", "high"), [(0.0, 1e3), (2.5, 3.0)])
def test_pressures_are_those_of_the_stream_within_limits(low: float, high: float) -> None:
    lines = Lines()
    one = node(lines, lowest=low, highest=high, safe=low)
    given = run(one, lines, {k: (wave(k),) for k in range(150)})
    stream = INVERSE.stream(PERIOD)
    expected = np.array([stream.step(wave(k)).copy() for k in range(150)])
    assert given == np.clip(expected, low, high).tolist()
    assert [said.data for said in lines.lines["p"].sent] == [pressure for (pressure,) in given]


def test_a_late_reference_is_held_and_silence_is_safe() -> None:
    """Up to the time-out the last good reference stands; then it is safe, and memory stands."""
    lines = Lines()
    one = node(lines, reference=Topic("r", KINDS["Float64MultiArray"]), safe=0.5, timeout=0.105)
    bad = [(np.nan,), (np.inf,), (), (1.0, 2.0)]
    sent: dict[int, tuple[float, ...]] = {k: (wave(k),) for k in [*range(1, 60), *range(100, 150)]}
    given = run(one, lines, sent | {k: bad[k % 4] for k in range(60, 80)})
    stream = INVERSE.stream(PERIOD)
    held = [stream.step(wave(min(k, 59))).tolist() for k in range(1, 70)]
    assert given[0] == [0.5]
    assert given[1:70] == held
    assert given[70:100] == [[0.5]] * 30
    assert given[100:] == [stream.step(wave(k)).tolist() for k in range(100, 150)]
    assert (one.silences, one.refused) == (1, 20)


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_a_run_is_recorded_and_its_end_is_safe(tmp_path: Path) -> None:
    lines, at = Lines(), list[int]()
    fluid = Topic("p", KINDS["FluidPressure"])
    one = node(lines, pressure=fluid, safe=0.25, record=tmp_path / "run.mcap")

    def turns() -> Iterator[int]:
        for k in range(100):
            lines.say("r", wave(k))
            at.append(k)
            yield k
        at.append(100)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        one.run(turns(), lambda: PERIOD * at[-1], lambda: DAY + round(1e9 * PERIOD) * at[-1])
    (found,) = read(tmp_path / "run.mcap")
    stream = INVERSE.stream(PERIOD)
    expected = [float(stream.step(wave(k))[0]) for k in range(100)]
    np.testing.assert_allclose(found["pressure"], [*expected, 0.25], rtol=1e-12)
