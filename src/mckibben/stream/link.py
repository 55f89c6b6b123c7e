"""Numbers over UDP, in a format that a microcontroller can read without a library.

A packet is ``b"mck1"``, a 32-bit sequence number, a 32-bit count, as many 64-bit floating-point
numbers, and the CRC-32 of all before; everything little-endian. Packets that are not that, come late or
twice, from anyone but the peer, or hold what is not finite or beyond limits, are dropped and counted.
"""

from __future__ import annotations

import math
import socket
import struct
import sys
import time
import zlib
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError

MAGIC = b"mck1"
HEAD = struct.Struct("<4sII")
CHECK = struct.Struct("<I")
MOST = 128
"""Numbers in a packet."""

HALF = 1 << 31
"""Sequence numbers ahead by less than this are newer, beyond it older: they wrap around."""

SILENCE = 0.5
"""When nothing newer has come for so long [s], the peer has started again, and any number is taken.

Until then a packet from before its start, which a network may deliver late or someone again, is old.
"""

BUFFERED = 512
"""Packets looked at once the time is up: more than a system's buffer holds."""


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
    """A two-way link to one peer: sends numbers, and receives its newest ones.

    Nobody is heard or answered before the peer is named, by its address and port, here or by `accept`.
    That keeps out strangers and mistakes, not someone on the same network who forges the peer's
    address: give robot and controller a network of their own.

    Parameters
    ----------
    peer : (str, int), optional
        Address and port of the other end; default none yet.
    bind : (str, int), optional
        Own address; port 0 for any free one. Default this machine alone, or all of its networks where
        the peer is on another.
    size : int
        Numbers in each packet that is expected; others are dropped.
    limits : sequence of (float, float), optional
        Lowest and highest value of each number that is expected; a packet with one beyond is dropped
        whole. NaN and infinity are, limits or none.

    Attributes
    ----------
    dropped : int
        Packets that came and were not taken, or could not be sent.
    restarts : int
        How often the peer was taken to have started again.

    Raises
    ------
    DataError
        On addresses that are none or cannot be listened on, and on limits that do not fit.
    """

    def __init__(
        self,
        peer: tuple[str, int] | None = None,
        *,
        bind: tuple[str, int] | None = None,
        size: int,
        limits: Sequence[tuple[float, float]] | None = None,
    ) -> None:
        if not 0 < size <= MOST:
            raise DataError(f"a packet of {size} numbers", remedy=f"give 1 to {MOST}")
        self._size, self._limits = size, _checked(limits, size)
        named = None if peer is None else _resolved(peer)
        host, port = bind or ("127.0.0.1" if named is None or _here(named) else "", 0)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise DataError(
                f"{host}:{port} cannot be listened on ({getattr(error, 'strerror', None) or error})",
                remedy="give a free port of this machine",
            ) from None
        self._peer: tuple[str, int] | None = None
        self._connected = False
        self._sequence, self._seen, self._heard = 0, -1, -math.inf
        self.dropped = self.restarts = 0
        if named is not None:
            try:
                self.accept(named)
            except DataError:
                self.close()
                raise

    @property
    def address(self) -> tuple[str, int]:
        """Own address and port."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def accept(self, peer: tuple[str, int]) -> None:
        """Set the peer: the only one to send to and receive from.

        Parameters
        ----------
        peer : (str, int)
            Its address and port.

        Raises
        ------
        DataError
            If it is no address, or on another machine where the link is bound to this one alone.
        """
        named = _resolved(peer)
        if _here(self.address) and not _here(named):
            raise DataError(
                f"{named[0]} is another machine, and the link is bound to this one",
                remedy="give bind=('', PORT)",
            )
        self._peer, self._connected = named, False
        self._seen, self._heard = -1, -math.inf
        self._connect()

    def _connect(self) -> bool:
        # from then on the system itself keeps strangers out, who else could fill its buffer
        if not self._connected and self._peer is not None:
            with suppress(OSError):  # no way there yet
                self._socket.connect(self._peer)
                self._connected = True
        return self._connected

    def send(self, values: ArrayLike) -> None:
        """Send numbers to the peer; an unreachable peer is not an error.

        Parameters
        ----------
        values : array-like, shape (n,)
            Finite, 1 to 128 of them.

        Raises
        ------
        DataError
            If no peer is named, or the values are not such numbers.
        """
        if self._peer is None:
            raise DataError("no peer is named", remedy="give it as peer=, or call accept()")
        try:
            sent = np.asarray(values, dtype=np.float64).ravel().tolist()
        except (TypeError, ValueError):
            sent = []
        if not 0 < len(sent) <= MOST or not all(map(math.isfinite, sent)):
            raise DataError(
                f"{values!r:.100} is not sent",
                remedy=f"send 1 to {MOST} finite numbers; hold the last where one is missing",
            )
        self._sequence += 1
        try:
            if self._connected or self._connect():
                self._socket.send(packed(self._sequence, sent))
                return
        except OSError:  # nobody listens, or there is no way there
            pass
        self.dropped += 1

    def newest(self, timeout: float = 0.0) -> Array | None:
        """Return the newest numbers received since the last call, or None.

        Whatever else comes, it returns when the time is up, with the newest good numbers of the packets
        that a buffer holds.

        Parameters
        ----------
        timeout : float
            How long to wait where none has come yet [s].
        """
        until = time.monotonic() + timeout
        found: Array | None = None
        taken = 0
        while taken < BUFFERED:
            left = until - time.monotonic() if found is None and timeout else 0.0
            if left <= 0.0:
                left = 0.0
                taken += 1
            try:
                self._socket.settimeout(left)
                packet, sender = self._socket.recvfrom(4096)
            except (TimeoutError, BlockingIOError):
                return found
            except OSError:  # nobody listens there, or there is no way
                if self._socket.fileno() < 0:
                    raise
                continue
            values = self._good(packet, sender)
            if values is None:
                self.dropped += 1
            else:
                found = values
        return found

    def _good(self, packet: bytes, sender: tuple[str, int]) -> Array | None:
        """Return the numbers of a packet that is new, from the peer, and within the limits."""
        content = unpacked(packet) if sender == self._peer else None
        if content is None or content[1].size != self._size:
            return None
        sequence, values = content
        for value, (low, high) in zip(values.tolist(), self._limits, strict=True):
            if not low <= value <= high:  # as NaN never is
                return None
        now = time.monotonic()
        ahead = (sequence - self._seen) % (2 * HALF)
        if self._seen >= 0 and not 0 < ahead < HALF:
            if ahead == 0 or now - self._heard < SILENCE:
                return None
            self.restarts += 1
        self._seen, self._heard = sequence, now
        return values

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


def _resolved(peer: tuple[str, int]) -> tuple[str, int]:
    """Return an address as in packets."""
    try:
        host, port = peer
        if 0 < port < 2**16:
            return socket.gethostbyname(host), port
        reason = f"{port} is no port"
    except (OSError, TypeError, ValueError) as error:
        reason = str(error)
    raise DataError(
        f"{peer!r:.100} is no peer ({reason})", remedy="give its address and port"
    ) from None


def _here(address: tuple[str, int]) -> bool:
    return address[0].startswith("127.")


def _checked(
    limits: Sequence[tuple[float, float]] | None, size: int
) -> tuple[tuple[float, float], ...]:
    """Return the lowest and the highest of each number, both finite."""
    found = ((-np.inf, np.inf),) * size if limits is None else tuple(limits)
    if len(found) != size or not all(len(pair) == 2 and pair[0] <= pair[1] for pair in found):
        raise DataError(
            f"limits {limits!r:.100} for {size} numbers",
            remedy="give a lowest and a highest value for each number",
        )
    most = sys.float_info.max
    return tuple((max(float(low), -most), min(float(high), most)) for low, high in found)
