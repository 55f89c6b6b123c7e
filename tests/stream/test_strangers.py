"""A robot over UDP hears nobody but its peer, no old packet and no command beyond its limits."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator

import numpy as np
import pytest

from mckibben import DataError
from mckibben.stream import UDPLink
from mckibben.stream.link import packed


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    """Be the other end that is named, by hand."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        yield made


@pytest.fixture
def stranger() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(0.1)
        yield made


def test_a_stranger_takes_over_neither_ear_nor_mouth(
    peer: socket.socket, stranger: socket.socket
) -> None:
    with UDPLink(size=1) as link:
        stranger.sendto(packed(1, [5.0]), link.address)  # in the buffer before the peer is named
        link.accept(peer.getsockname())
        stranger.sendto(packed(2, [6.0]), link.address)
        assert link.newest(timeout=0.1) is None
        link.send([7.0])
        assert peer.recv(100) == packed(1, [7.0])
        with pytest.raises(TimeoutError):
            stranger.recv(100)


@pytest.mark.parametrize("value", [5.01, -0.01, math.nan, math.inf, -math.inf, 1e300])
def test_a_command_beyond_the_limits_is_dropped_whole(value: float, peer: socket.socket) -> None:
    with UDPLink(peer.getsockname(), size=2, limits=[(0.0, 5.0), (0.0, 5.0)]) as link:
        peer.sendto(packed(1, [5.0, 0.0]), link.address)
        peer.sendto(packed(2, [1.0, value]), link.address)
        np.testing.assert_array_equal(link.newest(timeout=2.0), [5.0, 0.0])
        assert link.newest(timeout=0.05) is None
        assert link.dropped == 1


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_neither_taken_nor_sent(value: float, peer: socket.socket) -> None:
    with UDPLink(peer.getsockname(), size=1, limits=[(0.0, math.inf)]) as link:
        peer.sendto(packed(1, [value]), link.address)
        assert link.newest(timeout=0.05) is None
        for values in ([value], [], ["a"], [[1.0], [2.0, 3.0]], np.zeros(200), None):
            with pytest.raises(DataError, match="1 to 128"):
                link.send(values)  # type: ignore[arg-type]  # that is the attack
