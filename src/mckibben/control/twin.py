"""Twin: a fitted model used as a plant, with scatter according to its band.

    y[t] = P[u][t] + s sign(g[t]) Q(|g[t]|),   (1 - r / q)² g = c n

where P is the model; s = 1 + k |dy/dt| is its band's (`mckibben.blocks.bands`), Q gives the score that
the share of |g| below it reaches, n is white and normal, 1 / q delays, and c makes g of variance 1. So
the band at any level holds that share of the samples, or more, and r keeps them alike for as long as the
errors of the calibration were. No muscle jumps, so what is drawn does not either: Q rises straight
between levels, where the scores of few runs are stairs, and s follows the band within as long as errors
stay alike.
Without a band nothing scatters, and outputs are those of ``model.simulate``, to the bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import erf, sqrt
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.bands import Band, Banded, inside
from mckibben.blocks.base import Block
from mckibben.blocks.inverse import commands, drives
from mckibben.blocks.running import Stream
from mckibben.control.identified import known_ranges
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.signals.checking import generator

COMMAND = "command_"
"""Prefix of commands in recordings, which plants do not use."""


def plain(name: str) -> str:
    """Return the plant's name of a channel."""
    return name.removeprefix(COMMAND)


class Ends(NamedTuple):
    """Lowest and highest value of a channel."""

    low: float
    high: float


ANY = Ends(-np.inf, np.inf)


class Twin:
    """A fitted model as a plant, for testing a compensator as on a rig.

    Parameters
    ----------
    model : Block
        From pressures, or commands, and what is held, to motions or a force. With a band
        (`mckibben.calibrate`), outputs scatter as that says.
    limits : mapping of str to (float, float), optional
        Lowest and highest pressure [bar], or command, by input; default what the model was identified
        on, as far as it knows. Commands beyond are clipped.
    held : mapping of str to float, optional
        Inputs that nothing drives, such as a load [N], a length [mm] or an extensor's pressure [bar].
        What a reference gives comes first.
    sample_time : float, optional
        Time that a command is held [s]; default the model's own, or 0.02 s.
    name : str
        In tables and recordings.
    scatter_after : float
        Time from which it scatters [s].
    rest_length : float, optional
        Length of the muscle where its displacement is 0 [mm].

    Raises
    ------
    ModelError
        If the model gives pressures or commands, or does not take the sample time.
    DataError
        On limits or held values of what is no input, or out of order.

    Examples
    --------
    >>> from mckibben import PI
    >>> from mckibben.control import Twin
    >>> twin = Twin(PI.example())
    >>> first = twin.reset()
    >>> moved = twin.step({"pressure": 3.0})
    >>> bool(moved[0] == PI.example().simulate([0.0, 3.0])[1])
    True
    """

    def __init__(
        self,
        model: Block,
        *,
        limits: Mapping[str, tuple[float, float]] | None = None,
        held: Mapping[str, float] | None = None,
        sample_time: float | None = None,
        name: str = "twin",
        scatter_after: float = 0.0,
        rest_length: float | None = None,
    ) -> None:
        self.model, self.name, self.scatter_after = model, name, scatter_after
        self.forward, self.rest_length = inside(model), rest_length
        outputs = tuple(channel.name for channel in self.forward.outputs)
        if commands(self.forward) or any(map(drives, self.forward.outputs)):
            raise ModelError(
                f"{self.forward.title!r} gives {', '.join(outputs)}, and loops follow "
                "motions or a force",
                remedy="give the model of a muscle, not its inverse",
            )
        self.outputs = outputs
        self.inputs = tuple(plain(c.name) for c in self.forward.inputs)
        ends = (*self.forward.inputs, *self.forward.outputs)
        self.units = {plain(channel.name): channel.unit for channel in ends}
        own = self.forward.sample_time
        self.sample_time = float(sample_time or own or 0.02)
        if own is not None and abs(self.sample_time - own) > 1e-9 * own:
            raise ModelError(
                f"{self.forward.title!r} is a model of steps of {own:g} s, and a loop of "
                f"{self.sample_time:g} s is closed on it",
                remedy="resample the reference to that, or take a model of any sample time",
            )
        self.held = dict(held or {})
        given = {name: Ends(*map(float, ends)) for name, ends in (limits or {}).items()}
        for channel in (*given, *self.held):
            if channel not in self.inputs:
                raise DataError(
                    f"{self.forward.title!r} has no such input; it has {', '.join(self.inputs)}",
                    channel=channel,
                    remedy="name one of these",
                )
        for channel, (low, high) in given.items():
            if not -np.inf < low < high < np.inf:
                raise DataError(
                    f"limits are {low:g} to {high:g}", channel=channel, remedy="give low, then high"
                )
        self._given = given
        known = {plain(n): Ends(*e) for n, e in known_ranges(model).items()}
        self._limits = known | given
        self._rest = np.empty(0)
        self._stream: Stream | None = None
        self._scatter: _Scatter | None = None

    def __repr__(self) -> str:
        """Return its name, its model, and the limits of its commands."""
        ends = {name: tuple(self._limits[name]) for name in self.inputs if name in self._limits}
        band = f", band {self.model.band.level:g}" if isinstance(self.model, Banded) else ""
        return f"Twin({self.name!r}, {self.forward.title!r}{band}, limits={ends}, held={self.held})"

    @property
    def scatters(self) -> bool:
        """Whether it has a band."""
        return isinstance(self.model, Banded)

    @property
    def drawn(self) -> Array:
        """The scatter of the last measurement, shape (outputs,)."""
        return np.zeros(len(self.outputs)) if self._scatter is None else self._scatter.drawn

    def limits(self, name: str) -> Ends:
        """Return the lowest and highest of an input.

        Raises
        ------
        ModelError
            If neither the model nor its user says.
        """
        if name not in self._limits:
            raise ModelError(
                f"{self.forward.title!r} has no limits of {name}",
                remedy=f"give `limits[{name}]=LOW:HIGH`, or calibrate it",
            )
        return self._limits[name]

    def changed(self, settings: Mapping[str, Any]) -> Self:
        """Return the same twin with another ``sample_time``, ``scatter_after``, or ``start.NAME``.

        Raises
        ------
        DataError
            On other settings.
        ModelError
            If the model does not take the sample time.
        """
        held = dict(self.held)
        own = {"sample_time": self.sample_time, "scatter_after": self.scatter_after}
        for setting, value in settings.items():
            if setting in own:
                own[setting] = float(value)
            elif setting.startswith("start."):
                held[setting.removeprefix("start.")] = float(value)
            else:
                raise DataError(
                    f"a twin has no setting {setting!r}",
                    remedy="give sample_time, scatter_after, or start.NAME",
                )
        given, length = self._given, self.rest_length
        return type(self)(
            self.model, limits=given, held=held, name=self.name, rest_length=length, **own
        )

    def reset(self, seed: int = 0) -> Array:
        """Bring it to rest with the lowest commands, and return the first measurement."""
        self._begin(seed)
        self._rest = np.array([self._resting(name) for name in self.inputs])
        return self._measured(self._rest)

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for one sample time and return the next measurement, shape (outputs,).

        Parameters
        ----------
        action : array_like, shape (inputs,), or mapping
            One number an input, in their order; or by name, others staying at rest.

        Raises
        ------
        DataError
            Before `reset`, or on unknown channels or another number of them.
        ModelError
            If the model runs away.
        """
        if self._stream is None:
            raise DataError("the twin is not running", remedy="call reset() first")
        if isinstance(action, Mapping):
            row = self._rest.copy()
            for name, value in action.items():
                if name not in self.inputs:
                    raise DataError(
                        "the twin has no such input", channel=name, remedy=", ".join(self.inputs)
                    )
                row[self.inputs.index(name)] = value
        else:
            row = np.array(action, dtype=np.float64)
            if row.shape != self._rest.shape:
                raise DataError(
                    f"an action has shape {row.shape}", remedy=f"give {', '.join(self.inputs)}"
                )
        return self._measured(row)

    def run(self, inputs: Recording, seed: int = 0, *, ideal: bool = False) -> Recording:
        """Run it over a recording of its inputs, as ``model.simulate`` does, with scatter.

        Parameters
        ----------
        inputs : Recording
            With time; inputs that it lacks are held.
        seed : int
            Of the scatter.
        ideal : bool
            Without scatter.
        """
        twin = self.changed({"sample_time": inputs.sample_time or self.sample_time})
        twin._begin(seed, ideal=ideal)
        columns = [
            inputs[name] if name in inputs else np.full(len(inputs), twin._resting(name))
            for name in twin.inputs
        ]
        found = np.array([twin._measured(row) for row in np.column_stack(columns)])
        given = dict(zip(twin.inputs, columns, strict=True))
        return Recording(
            given | dict(zip(twin.outputs, found.T, strict=True)),
            twin.sample_time,
            start_time=inputs.start_time,
            meta={"plant": twin.name},
        )

    def _begin(self, seed: int, *, ideal: bool = False) -> None:
        rng = generator(seed)
        free = self.driving.difference(self.held)
        ends = [self._limits[n] if n in free & set(self._limits) else ANY for n in self.inputs]
        self._clips = np.transpose(ends)  # what the hardware lets through
        self._scatter = None
        if isinstance(self.model, Banded) and not ideal:
            self._scatter = _Scatter(
                self.model.band, self.sample_time, rng, round(self.scatter_after / self.sample_time)
            )
            self._stream = Banded(self.forward, self._scatter.unit_band).stream(self.sample_time)
        else:
            self._stream = self.forward.stream(self.sample_time)

    @property
    def driving(self) -> set[str]:
        """Inputs driven by a controller: commands, or, without any, all that are not held."""
        named = {plain(channel.name) for channel in self.forward.inputs if drives(channel)}
        return named or set(self.inputs).difference(self.held)

    def _resting(self, name: str) -> float:
        if name in self.held:
            return self.held[name]
        if name not in self.driving:
            raise DataError(
                "the plant's model needs it, and it is not given",
                channel=name,
                remedy="add the column to the reference, or set its constant value (held={...})",
            )
        return self.limits(name).low

    def _measured(self, row: Array) -> Array:
        assert self._stream is not None
        low, high = self._clips
        found = self._stream.step(np.minimum(np.maximum(row, low), high))
        if self._stream.status != Stream.GOOD:
            raise ModelError(
                f"{self.forward.title!r} gives no finite output at "
                f"{', '.join(f'{x:g}' for x in row)}",
                remedy="stay where it was identified, or identify it again",
            )
        return found.copy() if self._scatter is None else self._scatter.on(found)


class _Scatter:
    """Random scatter added to a model's outputs.

    The band's scale is read off one of score 1.
    """

    def __init__(
        self, band: Band, sample_time: float, rng: np.random.Generator, quiet: int
    ) -> None:
        n = len(band.given)
        self.unit_band = replace(band, scores=((1.0, 1.0),) * n, level=0.5)
        self._quantiles = [_quantiles(np.array(row)) for row in band.scores]
        self._keeps = r = _keeping(band.memory / sample_time)
        self._unit = sqrt((1.0 - r * r) ** 3 / (1.0 + r * r))
        self._rng, self._quiet = rng, quiet
        first, second = np.zeros((2, n)) if quiet else rng.standard_normal((2, n))
        # as after a long time; after a quiet one it grows from nothing
        once = first / sqrt(1.0 - r * r)
        self._once, self._twice = once, (once + r * second / sqrt(1.0 - r * r)) / (1.0 - r * r)
        self._scale = np.zeros(n) if quiet else None
        self.drawn = np.zeros(n)

    def on(self, found: Array) -> Array:
        """Return a sample of outputs with scatter, and advance."""
        y, _, upper = found.reshape(-1, 3).T
        if self._quiet > 0:
            self._quiet -= 1
            return np.array(y)
        scale = upper - y
        if self._scale is not None:
            scale = scale + self._keeps * (self._scale - scale)
        self._scale = scale
        scores = [
            np.copysign(np.interp(erf(abs(g) / sqrt(2.0)), *quantile), g)
            for g, quantile in zip(
                (self._unit * self._twice).tolist(), self._quantiles, strict=True
            )
        ]
        self._once = self._keeps * self._once + self._rng.standard_normal(self._once.size)
        self._twice = self._keeps * self._twice + self._once
        self.drawn = scale * np.array(scores)
        return np.asarray(y + self.drawn)


def _keeping(samples: float) -> float:
    """Return the autoregression coefficient with an integral correlation time of so many samples."""
    if samples <= 1.0:
        return 0.0
    from scipy.optimize import brentq  # slow to load

    return float(brentq(lambda r: (1.0 + r) ** 3 - samples * (1.0 - r) * (1.0 + r * r), 0.0, 1.0))


def _quantiles(scores: Array) -> tuple[Array, Array]:
    """Return levels and scores between which quantiles are interpolated.

    Between these no score is above that of its level, so that the band still holds its share.
    """
    levels = np.linspace(0.0, 1.0, scores.size)
    last = np.append(np.diff(scores) > 0, True)
    last[0] = False
    return np.append(0.0, levels[last]), np.append(0.0, scores[last])
