"""Twin: a fitted model used as a plant; outputs equal ``model.simulate`` to the bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.fields import drives
from mckibben.blocks.inverse import commands
from mckibben.blocks.ranges import known_ranges
from mckibben.errors import DataError, ModelError
from mckibben.recording import COMMAND, Recording


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
        From pressures or commands, and held inputs, to motions or a force. A band is ignored.
    limits : mapping of str to (float, float), optional
        Lowest and highest pressure [bar], or command, by input; default the model's identified range.
        Commands beyond are clipped.
    held : mapping of str to float, optional
        Constant inputs, such as a load [N], a length [mm] or an extensor's pressure [bar]. Channels of
        a reference take precedence.
    sample_time : float, optional
        Time that a command is held [s]; default the model's own. A model of any sample time that depends
        on rate needs it in `reset`; `track` gives it that of the reference.
    name : str
        In tables and recordings.
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
        rest_length: float | None = None,
    ) -> None:
        self.model, self.name = model, name
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
        self.sample_time = _checked_step(self.forward, sample_time)
        self.held = dict(held or {})
        self._given = {name: Ends(*map(float, ends)) for name, ends in (limits or {}).items()}
        self._check_channels()
        known = known_ranges(model.inputs, model.known_inputs)
        self._limits = {plain(name): Ends(*ends) for name, ends in known.items()} | self._given
        self._rest = np.empty(0)
        self._stream: Stream | None = None

    def _check_channels(self) -> None:
        """Raise an error for limits and held values of what is no input, or limits out of order."""
        for channel in (*self._given, *self.held):
            if channel not in self.inputs:
                raise DataError(
                    f"{self.forward.title!r} has no such input; it has {', '.join(self.inputs)}",
                    channel=channel,
                    remedy="name one of these",
                )
        for channel, (low, high) in self._given.items():
            if not -np.inf < low < high < np.inf:
                raise DataError(
                    f"limits are {low:g} to {high:g}", channel=channel, remedy="give low, then high"
                )

    def __repr__(self) -> str:
        """Return its name, its model, and the limits of its commands."""
        ends = {name: tuple(self._limits[name]) for name in self.inputs if name in self._limits}
        return f"Twin({self.name!r}, {self.forward.title!r}, limits={ends}, held={self.held})"

    def limits(self, name: str) -> Ends:
        """Return the lowest and highest of an input.

        Raises
        ------
        ModelError
            If neither the model nor `limits` has them.
        """
        if name not in self._limits:
            raise ModelError(
                f"{self.forward.title!r} has no limits of it",
                channel=name,
                remedy=f"give `limits[{name}]=LOW:HIGH`, or calibrate it",
            )
        return self._limits[name]

    def changed(self, settings: Mapping[str, Any]) -> Self:
        """Return the same twin with another ``sample_time``, or ``start.NAME``.

        Raises
        ------
        DataError
            On other settings.
        ModelError
            If the model does not take the sample time.
        """
        held = dict(self.held)
        step = self.sample_time
        for setting, value in settings.items():
            if setting == "sample_time":
                step = float(value)
            elif setting.startswith("start."):
                held[setting.removeprefix("start.")] = float(value)
            else:
                raise DataError(
                    "a twin has no such setting",
                    parameter=setting,
                    remedy="give sample_time, or start.NAME",
                )
        return type(self)(
            self.model,
            limits=self._given,
            held=held,
            sample_time=step,
            name=self.name,
            rest_length=self.rest_length,
        )

    def reset(self, seed: int = 0) -> Array:
        """Bring it to rest with the lowest commands, and return the first measurement."""
        del seed  # of the interface of plants; a model has no noise
        self._begin()
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

    def run(self, inputs: Recording) -> Recording:
        """Run it over a recording of its inputs, as ``model.simulate`` does; absent inputs are held."""
        step = inputs.sample_time
        twin = self.changed({} if step is None else {"sample_time": step})
        twin._begin()
        columns = [
            inputs[name] if name in inputs else np.full(len(inputs), twin._resting(name))
            for name in twin.inputs
        ]
        outputs = np.array([twin._measured(row) for row in np.column_stack(columns)])
        inputs_by_name = dict(zip(twin.inputs, columns, strict=True))
        return Recording(
            inputs_by_name | dict(zip(twin.outputs, outputs.T, strict=True)),
            twin.sample_time,
            start_time=inputs.start_time,
            meta={"plant": twin.name},
        )

    def _begin(self) -> None:
        free = self.driving.difference(self.held)
        ends = [self._limits[n] if n in free & set(self._limits) else ANY for n in self.inputs]
        self._clips = np.transpose(ends)
        self._stream = self.forward.stream(self.sample_time)

    @property
    def driving(self) -> set[str]:
        """Inputs driven by a controller: commands, or, without any, all that are not held."""
        commands_of_model = {
            plain(channel.name) for channel in self.forward.inputs if drives(channel)
        }
        return commands_of_model or set(self.inputs).difference(self.held)

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
        outputs = self._stream.step(np.minimum(np.maximum(row, low), high))
        if self._stream.status & (Stream.BAD_INPUT | Stream.BAD_OUTPUT):
            raise ModelError(
                f"{self.forward.title!r} is far beyond its identified range, or not finite, at "
                f"{', '.join(f'{x:g}' for x in row)}",
                remedy="stay where it was identified, or identify it again",
            )
        return outputs.copy()


def _checked_step(model: Block, sample_time: float | None) -> float | None:
    """Return the sample time of a loop on a model, by default the model's; raise an error if not its."""
    step = model.sample_time if sample_time is None else float(sample_time)
    if model.sample_time and step and abs(step - model.sample_time) > 1e-9 * model.sample_time:
        raise ModelError(
            f"{model.title!r} is a model of steps of {model.sample_time:g} s, and a loop of "
            f"{step:g} s is closed on it",
            parameter="sample_time",
            remedy="resample the reference to that, or take a model of any sample time",
        )
    return step
