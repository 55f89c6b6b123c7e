"""The link gives the newest good packet, and drops all else."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import DataError
from mckibben.stream import UDPLink
from mckibben.stream.link import packed, unpacked

EXAMPLES = Path(__file__).parents[2] / "examples"


@given(st.integers(0, 2**32 - 1), st.lists(st.floats(width=64), max_size=128))
def test_packets_keep_every_bit(sequence: int, values: list[float]) -> None:
    content = unpacked(packed(sequence, values))
    assert content is not None
    assert content[0] == sequence
    assert content[1].tobytes() == np.array(values, dtype=float).tobytes()


@given(st.data())
def test_noise_and_packets_with_a_flipped_bit_are_none(data: st.DataObject) -> None:
    assert unpacked(data.draw(st.binary(max_size=200))) is None
    packet = bytearray(packed(7, [1.0, -2.0]))
    place = data.draw(st.integers(0, 8 * len(packet) - 1))
    packet[place // 8] ^= 1 << place % 8
    assert unpacked(bytes(packet)) is None


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    """Be the other end, by hand."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        yield made


def test_both_ways_and_the_newest_wins() -> None:
    with UDPLink(size=2) as one, UDPLink(one.address, size=1) as other:
        one.accept(other.address)
        for k in range(5):
            other.send([float(k), 0.5])
        np.testing.assert_array_equal(one.newest(timeout=2.0), [4.0, 0.5])
        assert one.newest() is None
        one.send([9.0])
        np.testing.assert_array_equal(other.newest(timeout=2.0), [9.0])


def test_late_repeated_and_foreign_packets_are_dropped(peer: socket.socket) -> None:
    with UDPLink(peer.getsockname(), size=1) as link:
        wrong_size, old = packed(11, [1.0, 2.0]), packed(9, [3.0])
        for packet in (packed(10, [5.0]), packed(10, [6.0]), old, wrong_size, b"hello"):
            peer.sendto(packet, link.address)
        np.testing.assert_array_equal(link.newest(timeout=2.0), [5.0])
        link.newest(timeout=0.2)
        assert link.dropped == 4


def test_numbers_wrap_around_and_a_peer_that_starts_again_is_heard(
    peer: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    with UDPLink(peer.getsockname(), size=1) as link:
        for sequence, value in ((2**32 - 1, 1.0), (900, 2.0), (3, 3.0), (4, 4.0)):
            if sequence == 3:
                assert link.restarts == 0
                monkeypatch.setattr("mckibben.stream.link.SILENCE", 0.1)
                time.sleep(0.11)
            peer.sendto(packed(sequence, [value]), link.address)
            np.testing.assert_array_equal(link.newest(timeout=2.0), [value])
        assert link.restarts == 1


def test_a_peer_out_of_reach_is_no_error_and_bad_settings_are() -> None:
    with UDPLink(("192.0.2.1", 9), size=1) as link:
        link.send([1.0])
        with pytest.raises(DataError):
            UDPLink(bind=link.address, size=1)
    with pytest.raises(DataError, match="128"):
        UDPLink(size=0)


@pytest.mark.long
def test_a_controller_follows_a_robot_in_another_process() -> None:
    command = [sys.executable, str(EXAMPLES / "robot_loop.py"), "--duration", "4"]
    for _ in range(3):  # again only where other work kept it from its deadlines
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        missed = int(said.split(" deadlines missed")[0].split()[-1])
        if missed == 0:
            break
    assert float(said.split("within ")[1].split(" mm")[0]) < 1.0
