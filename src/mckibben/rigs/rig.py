"""A virtual rig: a validated set of physical parameters that can be run and stepped like hardware."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PrivateAttr, ValidationError, model_validator

from mckibben.errors import DataError, DataWarning
from mckibben.recording import Recording, standard_unit
from mckibben.rigs.parameters import Air, Range, Section, Sensor, parameter
from mckibben.rigs.physics.motion import MOTION, march
from mckibben.rigs.physics.muscle import MUSCLE_STATE
from mckibben.rigs.refusals import refused
from mckibben.signals.checking import generator

Array = NDArray[np.float64]
Records = NDArray[np.void]

SETTLING_SHARE = 0.3
"""Share of the settling time in which pressure and load rise; the rest is waited."""


ROOM_TEMPERATURE = 20.0
"""Where every muscle starts [degC]."""


class System(NamedTuple):
    """Muscles, regulator and mechanism, as the compiled physics reads them."""

    muscles: Records
    air: Records
    mechanism: Records


class Demands(NamedTuple):
    """What drives the physics at every sample: commands, loads on the coordinates, drive's target."""

    commands: Array
    loads: Array
    targets: Array


class Traces:
    """What sensors could see at every sample, by name; see `mckibben.rigs.physics.motion.march`."""

    def __init__(self, rows: Array, n_coordinates: int, n_muscles: int) -> None:
        n, m = n_coordinates, n_muscles
        ends = np.cumsum([n, n, m, m, m])
        parts = np.split(rows, ends, axis=1)
        self.place, self.acceleration, self.pressure, self.tension, self.room, self.warmth = parts


class Rig(Section, ABC):
    """What every rig has, whatever its set-up.

    Run it over a recording of commands with `run`, or sample by sample with `reset` and `step`.
    """

    setup: str = parameter("which physics: the name of the set-up")
    name: str = parameter("short name", min_length=1, pattern=r"^[a-z0-9][a-z0-9-]*$")
    version: int = parameter("counts up when results change", ge=1, default=1)
    title: str = parameter("one line about it", default="")
    source: str = parameter("where its numbers come from", default="")
    sample_time: float = parameter("time between two samples", "s", gt=0, le=1)
    integration_step: float = parameter(
        "longest step of the physics", "s", gt=0, le=0.005, default=5e-4
    )
    settling_time: float = parameter(
        "time from switching on to the first sample", "s", ge=1, default=20.0
    )
    tare: bool = parameter("whether displacement is counted from the first sample", default=False)
    start: dict[str, float] = parameter(
        "commands at rest, where not the lowest", default_factory=dict
    )
    range: dict[str, Range] = parameter("what the hardware lets through, by channel")
    sensor: dict[str, Sensor] = parameter("sensors, by channel")
    air: Air

    measurable: ClassVar[tuple[str, ...]]
    """Quantities that sensors of this set-up may measure."""

    _system: System | None = PrivateAttr(default=None)
    _rest: tuple[Records, Records] | None = PrivateAttr(default=None)
    _running: _Running | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _channels_fit(self) -> Self:
        for name in self.inputs:
            if not {name, quantity(name)} & set(self.range):
                raise ValueError(f"range: there is none for the input {name!r}")
        known = {*self.inputs, *map(quantity, self.inputs)}
        for section, given in (("range", self.range), ("start", self.start)):
            for name in given:
                if name not in known:
                    raise ValueError(f"{section}: {name!r} is no input; there are {sorted(known)}")
        for name in self.sensor:
            if name not in self.measurable:
                raise ValueError(f"sensor: {name!r} cannot be measured; {self.measurable} can")
        if not self.sensor:
            raise ValueError(f"sensor: there is none; {self.measurable} can be measured")
        for name in self.inputs:
            limits = self.limits(name)
            if not limits.low <= self._start(name) <= limits.high:
                raise ValueError(
                    f"start: {name} at {self._start(name):g} is not within its range "
                    f"{limits.low:g} to {limits.high:g}"
                )
        return self

    # --- what a set-up says

    @property
    @abstractmethod
    def inputs(self) -> tuple[str, ...]:
        """Channels that drive it, the first of which must be given."""

    @property
    @abstractmethod
    def outputs(self) -> tuple[str, ...]:
        """Channels that it measures."""

    @abstractmethod
    def build(self) -> System:
        """Return the muscles, regulator and mechanism."""

    @abstractmethod
    def demands(self, inputs: Array) -> Demands:
        """Return what given inputs, shape (n, inputs), ask of the physics."""

    @abstractmethod
    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        """Return what perfect sensors would show, by channel; ``zero`` is the place of the tare."""

    @abstractmethod
    def known(self) -> Mapping[str, Any]:
        """Return what a recording should say of the set-up: geometry, load."""

    # --- what is the same for all

    def changed(self, settings: Mapping[str, Any]) -> Self:
        """Return a rig with other parameters, checked like a new one.

        Parameters
        ----------
        settings : mapping
            By name, sections joined by dots: ``{"payload": 10.0, "muscle.wall": 2.0}``.

        Raises
        ------
        DataError
            On a name that the rig does not have, or a value outside its range.

        Examples
        --------
        >>> from mckibben.rigs import load_rig
        >>> load_rig("mas20-hanging").changed({"payload": 10.0}).payload
        10.0
        """
        fields = self.model_dump()
        for path, value in settings.items():
            place = fields
            *sections, last = path.split(".")
            for section in sections:
                place = place.get(section) if isinstance(place, dict) else None  # type: ignore[assignment]
            if not isinstance(place, dict) or (last not in place and sections != ["start"]):
                raise DataError(
                    f"the rig {self.name!r} has no parameter {path!r}",
                    remedy=f"see mckibben rig show {self.name}",
                )
            place[last] = value
        try:
            return type(self).model_validate(fields)
        except ValidationError as error:
            raise refused(error, type(self), f"rig {self.name}") from None

    def run(
        self, inputs: Recording, seed: int = 0, *, ideal: bool = False, held: bool = False
    ) -> Recording:
        """Run an experiment from rest.

        Parameters
        ----------
        inputs : Recording
            Commands, with time. The rig's first input must be among them; others stay at rest when
            absent. Channels that the rig measures are passed over.
        seed : int
            Of the sensor noise.
        ideal : bool
            Read perfect sensors, and add ``volume`` [ml] and ``temperature`` [degC] of the muscle(s).
        held : bool
            Hold each command until the next sample, as `step` does, rather than join them by lines.

        Returns
        -------
        Recording
            On the grid of ``inputs``: what was measured, and inputs that have no sensor as they were
            applied. ``meta["saturated"]`` counts samples whose command the hardware limited.

        Raises
        ------
        DataError
            On missing or unknown channels, or a recording without time.
        """
        given, saturated = self._applied(inputs)
        states, motion = (part.copy() for part in self._at_rest())
        traces = self._march(states, motion, self.demands(given), self._time_of(inputs), held)
        # A held command is seen from the next sample on.
        seen = np.vstack([self._resting(), given[:-1]]) if held else given
        readings = self._readings(traces, seen)
        if ideal:
            readings |= _inside(traces)
        else:
            rng = generator(seed)
            noise = rng.standard_normal((len(inputs), len(self.outputs)))
            readings = {
                name: self._sensed(name, samples, noise[:, i])
                for i, (name, samples) in enumerate(readings.items())
            }
        applied = {name: given[:, i] for i, name in enumerate(self.inputs) if name not in readings}
        for name, count in saturated.items():
            limits = self.limits(name)
            warnings.warn(
                DataWarning(
                    f"{name} was limited to {limits.low:g} to {limits.high:g} "
                    f"{standard_unit(name)} in {count} of {len(inputs)} samples, as {self.name} would"
                ),
                stacklevel=2,
            )
        return Recording(
            {**applied, **readings},
            inputs.sample_time,
            units={name: "ml" for name in readings if quantity(name) == "volume"},
            start_time=inputs.start_time,
            meta={
                **{
                    key: value
                    for key, value in inputs.meta.items()
                    if key not in ("file", "sha256")
                },
                "rig": f"{self.name} v{self.version} (virtual)",
                **self.known(),
                **({} if ideal else {"seed": seed}),
                **({"saturated": saturated} if saturated else {}),
            },
        )

    def reset(self, seed: int = 0) -> Array:
        """Bring the rig to rest and return its first measurement, in the order of ``outputs``.

        Raises
        ------
        DataError
            On a negative seed.
        """
        states, motion = (part.copy() for part in self._at_rest())
        running = _Running(states, motion, generator(seed))
        self._running = running
        rest = self._resting()
        traces = self._march(states, motion, self.demands(rest), self.sample_time, True)
        return self._measured(self._readings(traces, rest), running)

    def step(self, action: ArrayLike | Mapping[str, float]) -> Array:
        """Hold commands for one sample time and return the next measurement.

        Parameters
        ----------
        action : array_like, shape (inputs,), or mapping
            One command an input, in their order; or by name, others staying at rest. Beyond the
            range it is limited, as the hardware would; ``saturated`` then counts.

        Returns
        -------
        array, shape (outputs,)

        Raises
        ------
        DataError
            Before `reset`, or on wrong channels, a wrong number of commands, or one not finite.
        """
        running = self._running
        if running is None:
            raise DataError("the rig is not running", remedy="call reset() first")
        asked = self._asked(action)
        low = np.array([self.limits(name).low for name in self.inputs])
        high = np.array([self.limits(name).high for name in self.inputs])
        given = np.clip(asked, low, high)
        for name, limited in zip(self.inputs, given != asked, strict=True):
            if limited:
                running.saturated[name] = running.saturated.get(name, 0) + 1
        both = np.vstack([given, given])
        traces = self._march(
            running.states, running.motion, self.demands(both), self.sample_time, True
        )
        return self._measured(self._readings(traces, both), running)

    @property
    def saturated(self) -> Mapping[str, int]:
        """Steps since `reset` in which the hardware limited a command, by input."""
        return {} if self._running is None else dict(self._running.saturated)

    # --- inside

    def _measured(self, readings: Mapping[str, Array], running: _Running) -> Array:
        """Return the last of some readings as the sensors show it."""
        noise = running.rng.standard_normal(len(self.outputs))
        return np.array(
            [
                float(self._sensed(name, readings[name][-1:], noise[i])[0])
                for i, name in enumerate(self.outputs)
            ]
        )

    def _sensed(self, name: str, true: Array, noise: Array | float) -> Array:
        sensor = self.sensor[quantity(name)]
        shown = true + sensor.offset + sensor.noise * noise
        if sensor.resolution:
            shown = np.round(np.round(shown / sensor.resolution) * sensor.resolution, 12)
        return np.asarray(shown)

    def _built(self) -> System:
        if self._system is None:
            self._system = self.build()
        return self._system

    def _march(
        self, states: Records, motion: Records, demands: Demands, sample_time: float, held: bool
    ) -> Traces:
        """Let the physics go on through all samples, changing the states."""
        system = self._built()
        n, m = int(system.mechanism["n"][0]), system.muscles.size
        rows = np.empty((len(demands.commands), 2 * n + 4 * m))
        steps = max(int(np.ceil(sample_time / self.integration_step - 1e-9)), 1)
        march(
            *system,
            states,
            motion,
            np.ascontiguousarray(demands.commands),
            np.ascontiguousarray(demands.loads),
            np.ascontiguousarray(demands.targets),
            held,
            steps,
            sample_time / steps,
            rows,
        )
        return Traces(rows, n, m)

    def _readings(self, traces: Traces, inputs: Array) -> dict[str, Array]:
        zero = np.zeros(traces.place.shape[1])
        if self.tare:
            zero = self._at_rest()[1]["place"][0, : zero.size]
        found = self.readings(traces, inputs, zero)
        return {name: found[name] for name in self.outputs}

    def _at_rest(self) -> tuple[Records, Records]:
        """Return the state after switching on: pressure and load come slowly, then all settles."""
        if self._rest is None:
            system = self._built()
            states, motion = np.zeros(system.muscles.size, MUSCLE_STATE), np.zeros(1, MOTION)
            rest = self._resting()
            off = np.clip([[max(self.limits(name).low, 0.0) for name in self.inputs]], None, rest)
            demands = self.demands(np.vstack([off, rest, rest]))
            weight = system.mechanism["weight"][0, : demands.loads.shape[1]]
            demands.loads[0] -= weight
            demands.targets[:] = demands.targets[-1]
            for first, share in ((0, SETTLING_SHARE), (1, 1.0 - SETTLING_SHARE)):
                part = Demands(*(column[first : first + 2] for column in demands))
                self._march(states, motion, part, share * self.settling_time, False)
            self._rest = states, motion
        return self._rest

    def _resting(self) -> Array:
        """Return the commands at rest, shape (1, inputs)."""
        return np.array([[self._start(name) for name in self.inputs]])

    def limits(self, name: str) -> Range:
        """Return what the hardware lets through on an input channel."""
        return self.range[name] if name in self.range else self.range[quantity(name)]

    def _start(self, name: str) -> float:
        rest = self.start.get(name, self.start.get(quantity(name)))
        return self.limits(name).low if rest is None else rest

    def _time_of(self, inputs: Recording) -> float:
        if inputs.sample_time is None:
            raise DataError(
                "a recording without time cannot drive a rig",
                file=inputs.source,
                remedy="read it with --rate, or give Recording(..., sample_time=...)",
            )
        return inputs.sample_time

    def _applied(self, inputs: Recording) -> tuple[Array, dict[str, int]]:
        strangers = sorted(set(inputs.channels) - {*self.inputs, *self.outputs})
        if strangers or self.inputs[0] not in inputs:
            problem = (
                f"the rig {self.name!r} has no channel {', '.join(map(repr, strangers))}"
                if strangers
                else f"the rig {self.name!r} needs the channel {self.inputs[0]!r}"
            )
            raise DataError(
                problem, file=inputs.source, remedy=f"give {', '.join(self.inputs)} and no others"
            )
        columns, saturated = [], {}
        for name in self.inputs:
            limits = self.limits(name)
            asked = inputs[name] if name in inputs else np.full(len(inputs), self._start(name))
            given = np.clip(asked, limits.low, limits.high)
            count = int(np.count_nonzero(given != asked))
            if count:
                saturated[name] = count
            columns.append(given)
        return np.column_stack(columns), saturated

    def _asked(self, action: ArrayLike | Mapping[str, float]) -> Array:
        if isinstance(action, Mapping):
            strangers = sorted(set(action) - set(self.inputs))
            if strangers:
                raise DataError(
                    f"the rig {self.name!r} has no input {', '.join(map(repr, strangers))}",
                    remedy=f"give {', '.join(self.inputs)}",
                )
            action = [action.get(name, self._start(name)) for name in self.inputs]
        asked = np.asarray(action, dtype=float)
        if asked.shape != (len(self.inputs),):
            raise DataError(
                f"an action of shape {asked.shape} does not fit {len(self.inputs)} input(s)",
                remedy=f"give one number each for {', '.join(self.inputs)}",
            )
        if not np.isfinite(asked).all():
            name = self.inputs[int(np.flatnonzero(~np.isfinite(asked))[0])]
            limits = self.limits(name)
            raise DataError(
                f"the command is {asked[self.inputs.index(name)]}",
                channel=name,
                remedy=f"give a number from {limits.low:g} to {limits.high:g} {standard_unit(name)}",
            )
        return asked


class _Running:
    """What a rig that is being stepped remembers."""

    def __init__(self, states: Records, motion: Records, rng: np.random.Generator) -> None:
        self.states, self.motion, self.rng = states, motion, rng
        self.saturated: dict[str, int] = {}


def _inside(traces: Traces) -> dict[str, Array]:
    """Return what no sensor shows: volume [ml] and temperature [degC] of every muscle."""
    m = traces.room.shape[1]
    names = [""] if m == 1 else [f"_{j + 1}" for j in range(m)]
    found = {f"volume{name}": 1e-3 * traces.room[:, j] for j, name in enumerate(names)}
    return found | {
        f"temperature{name}": ROOM_TEMPERATURE + traces.warmth[:, j] for j, name in enumerate(names)
    }


def quantity(channel: str) -> str:
    """Return what a channel measures: ``pressure_2`` and ``pressure_extensor`` are ``pressure``."""
    return channel.partition("_")[0]
