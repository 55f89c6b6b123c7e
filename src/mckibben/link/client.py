"""A host's end of the wire: finds out what is there, and leads it."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.errors import DataError, require
from mckibben.link.device import (
    Counts,
    Device,
    Kind,
    Port,
    State,
    described,
    identified,
    stated,
    unfit,
)
from mckibben.link.exchange import WORDS, Exchange, LinkError, LostError, Statistics
from mckibben.link.ports import ByteStream, open_port

OPENINGS = 3
"""How often to open a session for one frame, at most."""


class Link:
    """Leads a model on a device, over any stream of bytes.

    A frame that is not answered is sent again under its number, by which the device knows it: whatever
    the line loses, damages or doubles, each command is carried out once, in order, or not at all.

    Parameters
    ----------
    stream : ByteStream, str or Path
        What bytes go over, or the serial port to open.
    baud : int
        Of a serial port [bits/s].
    lock_step : bool
        Whether the host's `step` steps the model; else the device's own timer does.
    watchdog : float, optional
        Silence after which the device takes its safe outputs [s]; default what it was exported with,
        which is the most.
    fingerprint : str, optional
        Of the model that must be there, as in the export's ``link.json``.
    timeout : float
        How long to wait for an answer before asking again [s].
    patience : float
        After which time without any answer to give up [s].
    reopen : bool
        Whether to lead a device again that has been switched off and on, or whose watchdog has acted.
        Its memory may then be another; it says so in `statistics`.
    clock : callable
        Time in seconds; other than real for tests.

    Raises
    ------
    LinkError
        If nothing answers, or it is another model.

    Examples
    --------
    ::

        with Link("/dev/ttyACM0", lock_step=True) as link:
            (bar,) = link.step([reference, measured]).outputs
    """

    def __init__(
        self,
        stream: ByteStream | str | Path,
        *,
        baud: int = 115200,
        lock_step: bool = False,
        watchdog: float | None = None,
        fingerprint: str | None = None,
        timeout: float = 0.05,
        patience: float = 2.0,
        reopen: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        line = open_port(stream, baud=baud) if isinstance(stream, str | Path) else stream
        self._exchange = Exchange(line, timeout=timeout, patience=patience, clock=clock)
        self._lock_step, self._watchdog, self._reopen = lock_step, watchdog, reopen
        self._session, self._led, self._every = 0, False, 0
        try:
            self.device = self._identify(fingerprint)
        except BaseException:
            line.close()
            raise

    def _identify(self, fingerprint: str | None) -> Device:
        device, _, n_in, n_out = identified(self._exchange.ask(Kind.IDENTIFY))
        if fingerprint is not None and fingerprint.lower() != device.fingerprint:
            raise LinkError(
                f"the device holds model {device.fingerprint}, not {fingerprint:.40}",
                remedy="load the program that was exported with it, or give the other fingerprint",
            )
        ports: list[Port] = []
        for place in range(n_in + n_out):
            ports.append(described(self._exchange.ask(Kind.DESCRIBE, bytes([place])), device))
        return replace(device, inputs=tuple(ports[:n_in]), outputs=tuple(ports[n_in:]))

    # -- leading -----------------------------------------------------------------------------

    @property
    def statistics(self) -> Statistics:
        """What was asked, repeated and dropped so far."""
        return self._exchange.statistics

    def step(self, inputs: ArrayLike) -> State:
        """Step the model on the device by one sample, and return how it stands then.

        Parameters
        ----------
        inputs : array-like, shape (n_inputs,)
            In the order of ``device.inputs``, within their limits. The last ``device.n_missable`` may be
            NaN, where a measurement is missing; beyond limits they are taken as missing.

        Raises
        ------
        DataError
            If the inputs are not that.
        LinkError
            If the link is not in lock-step, or nothing answers.
        """
        if not self._lock_step:
            raise LinkError(
                "the device's own timer steps the model",
                remedy="call set(), or give lock_step=True",
            )
        return self._inputs(inputs)

    def set(self, inputs: ArrayLike) -> State:
        """Give the inputs of the coming steps, which the device's timer takes.

        Returns what stands there before the next of them; see `step`.
        """
        if self._lock_step:
            raise LinkError("the host steps the model", remedy="call step()")
        return self._inputs(inputs)

    def _inputs(self, inputs: ArrayLike) -> State:
        ports = self.device.inputs
        try:
            values = np.asarray(inputs, dtype=np.float64).ravel()
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.size != len(ports):
            raise DataError(
                f"{inputs!r:.100} is sent to {len(ports)} input(s)",
                remedy=f"give {', '.join(port.name for port in ports)}",
            )
        body = self.device.packed(values)
        needed = ports[: len(ports) - self.device.n_missable]
        for port, value in zip(needed, self.device.numbers(body).tolist(), strict=False):
            if not port.low <= value <= port.high:  # as NaN never is
                raise DataError(
                    f"{value:g} {port.unit} is beyond the limits {port.low:g} to {port.high:g} that "
                    "were fixed at export",
                    channel=port.name,
                    remedy="stay within, or export the model with other limits",
                )
        return stated(self._lead(Kind.INPUTS, body), self.device, with_inputs=False)

    def stream(self, every: int) -> None:
        """Have the device tell every so many of its steps by itself, or none with 0; see `samples`."""
        require(0 <= every <= 0xFFFF, "every", every, "0 to 65535", DataError)
        self._lead(Kind.STREAM, struct.pack("<H", every))
        self._every = every

    def samples(self, timeout: float = 0.0) -> list[State]:
        """Return the steps that the device has told since, waiting so long for the first [s]."""
        exchange = self._exchange
        until = exchange.clock() + timeout
        exchange.take(0.0)
        while not exchange.samples and (left := until - exchange.clock()) > 0:
            exchange.take(left)
        found = []
        while exchange.samples:
            frame = exchange.samples.popleft()
            try:
                if self._led and frame.session == self._session:
                    found.append(stated(frame.body[1:], self.device, with_inputs=True))
                    continue
            except DataError:
                pass
            self.statistics.dropped += 1
        return found

    def keep(self) -> None:
        """Tell the watchdog that the host is there."""
        self._lead(Kind.KEEP)

    def reset(self) -> None:
        """Make the next step a first one: the model forgets everything."""
        self._lead(Kind.RESET)

    def release(self) -> None:
        """Lead no more: the device takes its safe outputs at once."""
        if self._led:
            self._led = False
            with suppress(LostError):  # it has let go by itself
                self._exchange.ask(Kind.RELEASE, session=self._session)

    # -- asking ------------------------------------------------------------------------------

    def state(self) -> State:
        """Return how the device stands; this leads nothing."""
        return stated(self._exchange.ask(Kind.STATE), self.device, with_inputs=True)

    def counts(self) -> Counts:
        """Return what the device has counted; this leads nothing."""
        return identified(self._exchange.ask(Kind.IDENTIFY))[1]

    def memory(self) -> Array:
        """Return the memory of the model, in the order of its C; see `mckibben.export.state_of`."""
        n, parts = self.device.n_memory, [np.empty(0)]
        for first in range(0, n, self.device.most):
            count = min(self.device.most, n - first)
            body = self._exchange.ask(Kind.READ, struct.pack("<HB", first, count))
            parts.append(self.device.numbers(body))
        found = np.concatenate(parts)
        if found.size != n:
            raise unfit("numbers")
        return found

    # -- frames ------------------------------------------------------------------------------

    def _lead(self, kind: Kind, body: bytes = b"") -> bytes:
        """Ask within the session, which is opened first where it must be."""
        for tried in range(OPENINGS):
            try:
                if not self._led:
                    self._open()
                return self._exchange.ask(kind, body, session=self._session)
            except LostError:
                lost, self._led = self._led, False
                if tried == OPENINGS - 1 or (lost and not self._reopen):
                    raise
                self.statistics.reopened += lost
        raise AssertionError("unreachable")

    def _open(self) -> None:
        device, *_ = identified(self._exchange.ask(Kind.IDENTIFY))
        if device.fingerprint != self.device.fingerprint:
            raise LinkError(
                f"the device holds model {device.fingerprint} now, not {self.device.fingerprint}",
                remedy="open the link again if that is meant",
            )
        ticks = device.silence
        if self._watchdog is not None:
            ticks = round(self._watchdog / device.period)
            wanted = f"{device.period:g} to {device.period * device.silence:g} s"
            require(1 <= ticks <= device.silence, "watchdog", self._watchdog, wanted, DataError)
        body = bytes.fromhex(device.fingerprint) + struct.pack("<BI", self._lock_step, ticks)
        self._session = (
            self._exchange.session + 1
        ) % WORDS  # by which the device knows that it is a later one
        self._exchange.ask(Kind.OPEN, body, session=self._session)
        self._led = True
        if self._every:
            self._exchange.ask(Kind.STREAM, struct.pack("<H", self._every), session=self._session)

    # -- ending ------------------------------------------------------------------------------

    def close(self) -> None:
        """Lead no more, and close the port."""
        try:
            self.release()
        except DataError:
            pass  # its watchdog does it
        finally:
            self._exchange.stream.close()

    def __enter__(self) -> Self:
        """Return the link."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Lead no more, and close the port."""
        self.close()
