"""A compensator between topics: the same pressures as its stream, and safe ones when nobody speaks."""

from __future__ import annotations

import os
import socket
import struct
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, load, muscles, read
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.errors import DataError, ModelError
from mckibben.ros.kinds import KINDS, Kind
from tests.attacks.commands import call

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


def test_pressures_are_those_of_the_stream() -> None:
    lines = Lines()
    given = run(node(lines), lines, {k: (wave(k),) for k in range(200)}, 200)
    stream = INVERSE.stream(PERIOD)
    assert given == [stream.step(wave(k)).tolist() for k in range(200)]
    assert [said.data for said in lines.lines["p"].sent] == [pressure for (pressure,) in given]


def test_a_late_reference_is_held_and_silence_is_safe() -> None:
    """Up to the time-out the last reference stands; then it is safe, and memory stands."""
    lines = Lines()
    one = node(lines, safe=0.5, timeout=0.105)
    said: dict[int, tuple[float, ...]]
    said = {k: (wave(k),) for k in [*range(1, 60), *range(100, 150)]}
    given = run(one, lines, said, 150)
    stream = INVERSE.stream(PERIOD)
    held = [stream.step(wave(min(k, 59))).tolist() for k in range(1, 70)]
    assert given[0] == [0.5]
    assert given[1:70] == held
    assert given[70:100] == [[0.5]] * 30
    assert given[100:] == [stream.step(wave(k)).tolist() for k in range(100, 150)]
    assert one.silences == 1


def test_the_end_is_safe_whatever_ends_it() -> None:
    lines = Lines()
    one = node(lines, safe=0.25)

    def turns() -> Any:
        for k in range(5):
            lines.say("r", wave(k))
            yield k
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        one.run(turns(), lambda: 0.0, lambda: DAY)
    assert lines.lines["p"].sent[-2].data > 0.25
    assert lines.lines["p"].sent[-1].data == 0.25


def test_the_end_is_safe_and_closed_where_nothing_more_can_be_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = Lines()
    one = node(lines, safe=0.25, record=tmp_path / "run.mcap")
    recorder = one._recorder
    assert recorder is not None

    def full(*_: object) -> None:
        raise OSError(28, "no space left")

    def turns() -> Any:
        lines.say("r", wave(0))
        yield 0
        monkeypatch.setattr(recorder, "write", full)
        yield 1

    with pytest.raises(OSError, match="no space left"):
        one.run(turns(), lambda: 0.0, lambda: DAY)
    assert lines.lines["p"].sent[-1].data == 0.25
    assert recorder._file.closed
    assert one.led


def test_numbers_that_are_none_are_not_applied() -> None:
    lines = Lines()
    one = node(lines, reference=Topic("r", KINDS["Float64MultiArray"]), timeout=0.05)
    bad = [(np.nan,), (np.inf,), (), (1.0, 2.0)]
    said = {0: (wave(0),)} | {k + 1: each for k, each in enumerate(bad * 5)}
    given = run(one, lines, said, 21)
    assert one.refused == 20
    assert given[5] == given[0]  # held
    assert given[7:] == [[0.0]] * 14  # and refused messages do not keep the watchdog quiet


def test_pressures_are_clipped() -> None:
    lines = Lines()
    one = node(lines, highest=3.0, lowest=2.5, safe=2.75)
    given = np.array(run(one, lines, {k: (wave(k),) for k in range(200)}, 200))
    assert given.min() == 2.5
    assert given.max() == 3.0


def test_what_else_is_asked_for_comes_from_its_topic() -> None:
    """References are the driven inputs, the rest is measured; both must speak."""
    balance = muscles.load("rail").balance
    with pytest.raises(DataError, match="needs force"):
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
    ("options", "said"),
    [
        ({"safe": 7.0, "highest": 6.0}, "safe pressure"),
        ({"highest": np.nan}, "safe pressure"),
        ({"timeout": 0.001}, "time-out"),
        ({"timeout": np.inf}, "time-out"),
        ({"pressure": Topic("p", KINDS["JointState"])}, "not bar"),
        ({"reference": Topic("r", KINDS["FluidPressure"])}, "not mm"),
        ({"block": GPI.example()}, "not pressures"),
    ],
)
def test_what_cannot_run_is_refused(options: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises((DataError, ModelError), match=said):
        node(Lines(), record=tmp_path / "run.mcap", **options)
    assert not (tmp_path / "run.mcap").exists()


def test_a_run_is_recorded(tmp_path: Path) -> None:
    lines = Lines()
    one = node(
        lines,
        pressure=Topic("p", KINDS["FluidPressure"]),
        measured=Topic("displacement"),
        record=tmp_path / "run.mcap",
    )
    given = []
    for k in range(100):
        lines.say("r", wave(k))
        lines.say("displacement", wave(k) + 0.5)
        given += one.step(PERIOD * k, DAY + round(1e9 * PERIOD) * k)
    one.close()
    (found,) = read(tmp_path / "run.mcap", units={"displacement": "mm"})
    np.testing.assert_allclose(found["pressure"], given, rtol=1e-12)
    np.testing.assert_array_equal(found["displacement"], [wave(k) + 0.5 for k in range(100)])


SPEAKER = """
import sys, time
from mckibben.ros.dds import Topics
from mckibben.ros.kinds import KINDS
from mckibben.ros.messages import Float64
to = Topics(int(sys.argv[1])).publish("/reference", KINDS["Float64"])
for _ in range(1000):
    to.send(Float64(3.25))
    time.sleep(0.02)
"""

DOMAIN = 101 + os.getpid() % 100
"""One for each process that tests."""


def test_another_process_is_heard_in_the_bytes_of_ros() -> None:
    """Over the loopback; what went over the wire is plain little-endian CDR, as rosbags reads it."""
    typesys = pytest.importorskip("rosbags.typesys")
    from mckibben.ros.dds import Topics

    heard = Topics(DOMAIN).subscribe("/reference", KINDS["Float64"])
    try:
        wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3))
        wire.bind(("lo", 0))
        wire.setblocking(False)
    except (AttributeError, OSError):
        wire = None
    speaker = subprocess.Popen([sys.executable, "-c", SPEAKER, str(DOMAIN)])
    packets = b""
    try:
        for _ in range(3000):
            found = heard.newest()
            while wire is not None:
                try:
                    packets += wire.recv(65536)
                except BlockingIOError:
                    break
            if found is not None:
                break
            time.sleep(0.01)
    finally:
        speaker.kill()
        speaker.wait()
        if wire is not None:
            wire.close()
    assert found is not None
    assert found.data == 3.25
    if wire is not None:
        at = packets.find(struct.pack("<d", 3.25))
        store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
        assert packets[at - 4 : at] == b"\x00\x01\x00\x00"
        assert store.deserialize_cdr(packets[at - 4 : at + 8], "std_msgs/msg/Float64").data == 3.25
        assert b"rt/reference\0" in packets
        assert b"std_msgs::msg::dds_::Float64_\0" in packets


def test_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    INVERSE.save("inverse.json")
    words = ["ros", "inverse.json", "--reference", "r", "--pressure", "p", "--highest", "6"]
    words += ["--domain", str(DOMAIN), "--duration", "0.1", "--safe", "0.5"]
    result = call(*words, "-o", "run.mcap", "--json")
    assert result.code == 0, result.err
    assert '"refused": 0' in result.out
    assert Path("run.mcap").stat().st_size > 100
    assert "No reference ever came on r;" in call(*words).out
    assert "does not learn" in call(*words, "--save", "learnt.json").err
    Adaptive.example().save("inverse.json")
    assert call(*words, "--measured", "m", "--save", "learnt.json").code == 0
    assert load("learnt.json") == Adaptive.example()
    again = call(*words, "-o", "run.mcap")
    assert again.code == 2
    assert "--force" in again.err
    for wrong in (["--reference", "a b"], ["--reference-type", "Float32"], ["--domain", "1000"]):
        assert call(*words, *wrong).code == 2


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
