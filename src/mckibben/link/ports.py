"""What bytes go over: a serial port, a pseudo-terminal, a socket, or whatever reads and writes."""

from __future__ import annotations

import math
import os
import select
import stat
import time
from pathlib import Path
from typing import Protocol

from mckibben.errors import DataError

WRITING = 1.0
"""How long a write may wait for a line that takes nothing [s]."""


class ByteStream(Protocol):
    """Two-way bytes."""

    def read(self, timeout: float) -> bytes:
        """Return what has come, waiting so long [s] where nothing has; nothing when that is over."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def close(self) -> None:
        """End it."""


class Descriptor:
    """Bytes over an open file descriptor, which it closes in the end: a terminal, a pipe, a socket.

    Parameters
    ----------
    number : int
        Of the descriptor; it is made non-blocking.
    name : str
        What to call it in errors.
    """

    def __init__(self, number: int, name: str = "the line") -> None:
        os.set_blocking(number, False)
        self._number, self._name = number, name

    def read(self, timeout: float) -> bytes:
        """Return what has come.

        Raises
        ------
        DataError
            If the other end is gone.
        """
        try:
            ready, _, _ = select.select([self._number], [], [], max(timeout, 0.0))
            came = os.read(self._number, 4096) if ready else b""
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._gone(error) from None
        if ready and not came:
            raise self._gone(None)
        return came

    def write(self, data: bytes) -> None:
        """Send all of it.

        Raises
        ------
        DataError
            If the other end is gone, or takes nothing for a second.
        """
        until, sent = time.monotonic() + WRITING, 0
        while sent < len(data):
            try:
                sent += os.write(self._number, data[sent:])
            except BlockingIOError:
                left = until - time.monotonic()
                if left <= 0 or not select.select([], [self._number], [], left)[1]:
                    raise self._gone(TimeoutError("it takes no bytes")) from None
            except (OSError, ValueError) as error:
                raise self._gone(error) from None

    def close(self) -> None:
        """Close it; more than once is no error."""
        if self._number >= 0:
            os.close(self._number)
            self._number = -1

    def _gone(self, error: Exception | None) -> DataError:
        why = f" ({getattr(error, 'strerror', None) or error})" if error else ""
        return DataError(
            f"{self._name} has been closed by the other end{why}",
            remedy="see that the device is on and plugged in, and open it again",
        )


def open_port(name: str | Path, *, baud: int = 115200) -> Descriptor:
    """Open a serial port or a pseudo-terminal, for this program alone.

    Parameters
    ----------
    name : str or Path
        Such as /dev/ttyACM0.
    baud : int
        Bits a second; of no meaning on USB and on pseudo-terminals.

    Raises
    ------
    DataError
        If it is no serial port, cannot be opened, or knows no such rate.
    """
    try:
        import termios
        import tty
    except ImportError:
        raise DataError(
            "serial ports are opened by name on Linux and macOS only",
            remedy="give Link an object with read, write and close, such as one around pyserial",
        ) from None
    rate = getattr(termios, f"B{baud}", None)
    if rate is None or not math.isfinite(baud) or baud <= 0:
        raise DataError(
            f"{baud} bits a second", remedy="give a usual rate, such as 115200 or 921600"
        )
    try:
        if not stat.S_ISCHR(Path(name).stat().st_mode):
            raise DataError(
                "it is no serial port", file=name, remedy="give one, such as /dev/ttyACM0"
            )
        number = os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise DataError(
            f"it cannot be opened ({error.strerror})",
            file=name,
            remedy="see that it is there, that nothing else has it open, and that you may read and "
            "write it (on Linux, group dialout)",
        ) from None
    try:
        tty.setraw(number)
        settings = termios.tcgetattr(number)
        settings[2] |= termios.CLOCAL | termios.CREAD
        settings[4] = settings[5] = rate
        termios.tcsetattr(number, termios.TCSANOW, settings)
        import fcntl

        fcntl.ioctl(number, termios.TIOCEXCL)
        termios.tcflush(number, termios.TCIOFLUSH)
    except (OSError, termios.error):
        os.close(number)
        raise DataError(
            "it is no serial port", file=name, remedy="give one, such as /dev/ttyACM0"
        ) from None
    return Descriptor(number, str(name))
