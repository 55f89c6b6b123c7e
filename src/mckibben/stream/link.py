"""Numbers over UDP, in a form that a microcontroller reads without a library.

A packet is ``b"mck1"``, a 32-bit sequence number, a 32-bit count, as many 64-bit floating-point
numbers, and the CRC-32 of all before; everything little-endian. Packets that are not that, or come
late or twice, are dropped and counted.
"""

from __future__ import annotations

import socket
import struct
import zlib
from collections.abc import Sequence
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.errors import DataError

Array = NDArray[np.float64]

MAGIC = b"mck1"
HEAD = struct.Struct("<4sII")
CHECK = struct.Struct("<I")
MOST = 128
"""Numbers in a packet."""

HALF = 1 << 31
"""Sequence numbers ahead by less than this are newer, beyond it older: they wrap around."""


def packed(sequence: int, values: Sequence[float]) -> bytes:
    """Return a packet of numbers."""
    body = HEAD.pack(MAGIC, sequence & 0xFFFFFFFF, len(values)) + struct.pack(
        f"<{len(values)}d", *values
    )
    return body + CHECK.pack(zlib.crc32(body))


def unpacked(packet: bytes) -> tuple[int, Array] | None:
    """Return the sequence number and the numbers of a packet, or None if it is not one."""
    if len(packet) < HEAD.size + CHECK.size:
        return None
    magic, sequence, count = HEAD.unpack_from(packet)
    end = HEAD.size + 8 * count
    if magic != MAGIC or count > MOST or len(packet) != end + CHECK.size:
        return None
    (check,) = CHECK.unpack_from(packet, end)
    if check != zlib.crc32(packet[:end]):
        return None
    return sequence, np.frombuffer(packet, dtype="<f8", count=count, offset=HEAD.size).copy()


class UDPLink:
    """A two-way link: send numbers, and take the newest that came.

    Parameters
    ----------
    peer : (str, int), optional
        Address to send to, and the only one listened to; default the one that the last good packet
        came from.
    bind : (str, int), optional
        Own address; port 0 for any free one. Default this machine alone, or all of its networks where
        the peer is on another.
    size : int
        Numbers in each packet that is expected; others are dropped.
    """

    def __init__(
        self,
        peer: tuple[str, int] | None = None,
        *,
        bind: tuple[str, int] | None = None,
        size: int,
    ) -> None:
        if not 0 < size <= MOST:
            raise DataError(f"a packet of {size} numbers", remedy=f"give 1 to {MOST}")
        self._fixed = None if peer is None else (socket.gethostbyname(peer[0]), peer[1])
        self._peer, self._size = self._fixed, size
        if bind is None:
            near = self._fixed is None or self._fixed[0].startswith("127.")
            bind = ("127.0.0.1" if near else "", 0)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(bind)
        except OSError as error:
            self._socket.close()
            raise DataError(
                f"{bind[0]}:{bind[1]} cannot be listened on ({error.strerror})",
                remedy="give a free port of this machine",
            ) from None
        self._sequence, self._seen = 0, -1
        self.dropped = 0

    @property
    def address(self) -> tuple[str, int]:
        """Own address and port."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def send(self, values: ArrayLike) -> None:
        """Send numbers, if it is known where to; a peer that does not listen is no error."""
        if self._peer is None:
            return
        self._sequence += 1
        packet = packed(self._sequence, np.asarray(values, dtype=np.float64).tolist())
        try:
            self._socket.sendto(packet, self._peer)
        except OSError:  # nobody listens, or there is no way there
            self.dropped += 1

    def newest(self, timeout: float = 0.0) -> Array | None:
        """Return the newest numbers that came since the last call, or None.

        Parameters
        ----------
        timeout : float
            How long to wait where none has come yet [s].
        """
        found: Array | None = None
        while True:
            self._socket.settimeout(0.0 if found is not None else timeout)
            try:
                packet, sender = self._socket.recvfrom(4096)
            except (TimeoutError, BlockingIOError):
                return found
            except ConnectionError:
                continue
            content = unpacked(packet)
            foreign = self._fixed is not None and sender != self._fixed
            if (
                foreign
                or content is None
                or content[1].size != self._size
                or not self._is_newer(content[0])
            ):
                self.dropped += 1
                continue
            self._seen, found = content
            self._peer = (str(sender[0]), int(sender[1]))

    def _is_newer(self, sequence: int) -> bool:
        # a peer that starts again counts from 1
        restarted = sequence == 1 and self._seen != 1
        return self._seen < 0 or restarted or 0 < (sequence - self._seen) % (2 * HALF) < HALF

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> Self:
        """Return the link."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the socket."""
        self.close()
