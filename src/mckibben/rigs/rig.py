"""A virtual rig: a validated set of physical parameters that can be run and stepped like hardware.

Its parameters are in a file, one of the package's or the user's; a recording of it has in its ``meta``
how it differs from the published rig of its name, from which it can be rebuilt.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PrivateAttr, ValidationError, model_validator

from mckibben import registry
from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import PROVENANCE, Recording, base_name
from mckibben.rigs.commands import Commands
from mckibben.rigs.files import PUBLISHED, REMEDY, describe, fields_of, rig_names
from mckibben.rigs.parameters import AGEING, Air, Muscle, Range, Section, Sensor, parameter
from mckibben.rigs.system import Demands, State, System, Traces
from mckibben.signals.checking import generator
from mckibben.system.atomic import write_text
from mckibben.system.ordinary import named_toml
from mckibben.system.showing import DrawsItself
from mckibben.system.validation import invalid

CHANGES = "rig_changes"
"""In the ``meta`` of what a rig recorded: how it differs from the published one."""


class Rig(DrawsItself, Section, ABC):
    """Base class of rigs of all set-ups.

    Run it over a recording of commands with `run`, or sample by sample with `reset` and `step`.
    """

    face: ClassVar[str] = "rig"

    setup: str = parameter("which physics: the name of the set-up")
    name: str = parameter("short name", min_length=1, pattern=r"^[a-z0-9][a-z0-9-]*$")
    version: int = parameter("incremented when results change", ge=1, default=1)
    title: str = parameter("one-line description", default="")
    source: str = parameter("source of its parameters", default="")
    sample_time: float = parameter("time between two samples", "s", gt=0, le=1)
    integration_step: float = parameter(
        "longest integration step", "s", gt=0, le=0.005, default=5e-4
    )
    settling_time: float = parameter(
        "time from switching on to the first sample", "s", ge=1, default=20.0
    )
    tare: bool = parameter("whether displacement is counted from the first sample", default=False)
    start: dict[str, float] = parameter(
        "commands at rest, where not the lowest", default_factory=dict
    )
    range: dict[str, Range] = parameter("limits of the hardware, by channel")
    sensor: dict[str, Sensor] = parameter("sensors, by channel")
    air: Air

    measurable: ClassVar[tuple[str, ...]]
    """Quantities that sensors of this set-up may measure."""

    _system: System | None = PrivateAttr(default=None)
    _rest: State | None = PrivateAttr(default=None)
    _commands: Commands | None = PrivateAttr(default=None)
    _running: _Running | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _channels_fit(self) -> Self:
        for name in self.inputs:
            if not {name, base_name(name)} & set(self.range):
                raise ValueError(f"range: there is none for the input {name!r}")
        channels = {*self.inputs, *map(base_name, self.inputs)}
        for section, ranges in (("range", self.range), ("start", self.start)):
            for name in ranges:
                if name not in channels:
                    raise ValueError(
                        f"{section}: {name!r} is no input; there are {sorted(channels)}"
                    )
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

    def __repr__(self) -> str:
        inputs, measured = ", ".join(self.inputs), ", ".join(self.outputs)
        return f"{type(self).__name__}({self.name}: {inputs} to {measured})"

    # --- what a set-up says

    @property
    @abstractmethod
    def inputs(self) -> tuple[str, ...]:
        """Driving channels; the first must be given."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured channels: those with sensors."""
        return tuple(name for name in self.measurable if name in self.sensor)

    @property
    def rest_length(self) -> float | None:
        """Length of its muscles at rest [mm]."""
        return self.known().get("rest_length")

    @abstractmethod
    def build(self) -> System:
        """Return the muscles, regulator and mechanism."""

    @abstractmethod
    def demands(self, inputs: Array) -> Demands:
        """Return the physical demands of inputs, shape (n, inputs)."""

    @abstractmethod
    def readings(self, traces: Traces, inputs: Array, zero: Array) -> Mapping[str, Array]:
        """Return readings of ideal sensors, by channel; ``zero`` is the position of the tare."""

    @abstractmethod
    def known(self) -> Mapping[str, Any]:
        """Return the metadata of the set-up for recordings: geometry, load."""

    # --- what is the same for all

    def changed(self, settings: Mapping[str, Any]) -> Self:
        """Return a rig with other parameters, validated.

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
            part = fields
            *sections, last = path.split(".")
            for section in sections:
                part = part.get(section) if isinstance(part, dict) else None  # type: ignore[assignment]
            if not isinstance(part, dict) or (last not in part and sections != ["start"]):
                names = part if isinstance(part, dict) else fields
                raise DataError(
                    f"the rig {self.name!r} has no such parameter",
                    parameter=path,
                    remedy=f"use one of {', '.join(names)}",
                )
            part[last] = value
        try:
            return type(self).model_validate(fields)
        except ValidationError as error:
            raise invalid(error, f"rig {self.name}", REMEDY) from None

    def aged(self, factors: Mapping[str, float]) -> Self:
        """Return the rig with aged muscles in its current state.

        Parameters
        ----------
        factors : mapping
            On ``stiffness`` and ``friction`` of its muscles as they are here; see `AGEING`.

        Raises
        ------
        DataError
            On another name, or a factor that makes no muscle.
        """
        settings: dict[str, Any] = {}
        for group, factor in factors.items():
            if group not in AGEING:
                raise DataError(
                    "muscles do not age in it",
                    parameter=group,
                    remedy=f"give one of {', '.join(AGEING)}",
                )
            for name, muscle in _muscles_in(self):
                for path in AGEING[group]:
                    value = attrgetter(path)(muscle)
                    scaled = (
                        [factor * v for v in value] if isinstance(value, tuple) else factor * value
                    )
                    settings[f"{name}.{path}"] = scaled
        made = self.changed(settings)
        made._rest, made._running = self._at_rest(), self._running
        return made

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
            Ideal sensors; adds the ``volume`` [ml] of every muscle.
        held : bool
            Hold each command until the next sample, as `step` does, rather than join them by lines.

        Returns
        -------
        Recording
            On the grid of ``inputs``: what was measured, and inputs that have no sensor as they
            were applied. ``meta["saturated"]`` counts samples whose command the hardware limited;
            ``meta["rig_changes"]`` says how it differs from the published rig of its name.

        Raises
        ------
        DataError
            On missing or unknown channels, or a recording without time.
        """
        changed = changes(self)
        given, saturated = self._commanded().of_recording(inputs)
        step = float(inputs.sample_time or 0.0)  # one without is refused above
        traces = self._march(self._at_rest().copy(), given, step, held)
        # A held command is seen from the next sample on.
        seen = np.vstack([self.resting, given[:-1]]) if held else given
        readings = self._readings(traces, seen)
        self._refuse_divergence(readings)
        if ideal:
            readings |= _volumes(traces)
        else:
            rng = generator(seed)
            noise = rng.standard_normal((len(inputs), len(self.outputs)))
            readings = {
                name: self._sensed(name, samples, noise[:, i])
                for i, (name, samples) in enumerate(readings.items())
            }
        applied = {name: given[:, i] for i, name in enumerate(self.inputs) if name not in readings}
        return Recording(
            {**applied, **readings},
            inputs.sample_time,
            units={name: "ml" for name in readings if base_name(name) == "volume"},
            start_time=inputs.start_time,
            meta={
                **{key: value for key, value in inputs.meta.items() if key not in PROVENANCE},
                "rig": self.signature,
                **({} if changed is None else {CHANGES: changed}),
                **self.known(),
                **({} if ideal else {"seed": seed}),
                **({"saturated": saturated} if saturated else {}),
            },
        )

    def _refuse_divergence(self, readings: Mapping[str, Array]) -> None:
        """Raise an error for diverging motion, or pressure above the supply."""
        # what is thrown flies some way
        highest = {
            "pressure": 2 * self.air.supply,
            "displacement": 10 * (self.rest_length or np.inf),
        }
        for name, samples in readings.items():
            if not (np.abs(samples) < highest.get(base_name(name), np.inf)).all():
                raise DataError(
                    f"the simulation of {self.name!r} diverges: its steps are too long for it",
                    channel=name,
                    remedy=f"set integration_step to {self.integration_step / 5:g}, or more moved_mass",
                )

    def reset(self, seed: int = 0) -> Array:
        """Bring the rig to rest and return its first measurement, in the order of ``outputs``.

        Raises
        ------
        DataError
            On a negative seed.
        """
        running = _Running(self._at_rest().copy(), generator(seed))
        self._running = running
        traces = self._march(running.state, self.resting, self.sample_time, held=True)
        return self._measured(self._readings(traces, self.resting), running)

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
        action_commands = self._commanded().of_action(action)
        commands = self._commanded().limited(action_commands)
        for name, beyond in zip(self.inputs, commands != action_commands, strict=True):
            if beyond:
                running.saturated[name] = running.saturated.get(name, 0) + 1
        rows = np.vstack([commands, commands])
        traces = self._march(running.state, rows, self.sample_time, held=True)
        return self._measured(self._readings(traces, rows), running)

    def limits(self, name: str) -> Range:
        """Return the hardware limits of an input channel."""
        return self.range[name] if name in self.range else self.range[base_name(name)]

    @property
    def signature(self) -> str:
        """Return its name for recordings."""
        return f"{self.name} v{self.version} (virtual)"

    @property
    def resting(self) -> Array:
        """Commands at rest, shape (1, inputs)."""
        return np.array([[self._start(name) for name in self.inputs]])

    @property
    def saturated(self) -> Mapping[str, int]:
        """Steps since `reset` in which the hardware limited a command, by input."""
        return {} if self._running is None else dict(self._running.saturated)

    # --- inside

    def _measured(self, readings: Mapping[str, Array], running: _Running) -> Array:
        """Return the last of some readings, as measured by the sensors."""
        noise = running.rng.standard_normal(len(self.outputs))
        return np.array(
            [
                float(self._sensed(name, readings[name][-1:], noise[i])[0])
                for i, name in enumerate(self.outputs)
            ]
        )

    def _sensed(self, name: str, true: Array, noise: Array | float) -> Array:
        sensor = self.sensor[base_name(name)]
        reading = true + sensor.offset + sensor.noise * noise
        if sensor.resolution:
            reading = np.round(np.round(reading / sensor.resolution) * sensor.resolution, 12)
        return np.asarray(reading)

    def _built(self) -> System:
        if self._system is None:
            self._system = self.build()
        return self._system

    def _commanded(self) -> Commands:
        if self._commands is None:
            ranges = {name: self.limits(name) for name in self.inputs}
            self._commands = Commands(self.name, ranges, self.resting[0], self.outputs)
        return self._commands

    def _march(self, state: State, inputs: Array, sample_time: float, held: bool) -> Traces:
        return self._built().run(
            state, self.demands(inputs), sample_time, self.integration_step, held
        )

    def _readings(self, traces: Traces, inputs: Array) -> dict[str, Array]:
        zero = np.zeros(traces.place.shape[1])
        if self.tare:
            zero = self._at_rest().motion["place"][0, : zero.size]
        readings = self.readings(traces, inputs, zero)
        return {name: readings[name] for name in self.outputs}

    def _at_rest(self) -> State:
        """Return the state after switching on."""
        if self._rest is None:
            off = np.clip([[max(self.limits(n).low, 0.0) for n in self.inputs]], None, self.resting)
            demands = self.demands(np.vstack([off, self.resting]))
            demands.targets[0] = demands.targets[1]
            self._rest = self._built().switched_on(
                demands, self.settling_time, self.integration_step
            )
        return self._rest

    def _start(self, name: str) -> float:
        level = self.start.get(name, self.start.get(base_name(name)))
        return self.limits(name).low if level is None else level


class _Running:
    """State of a rig that is being stepped."""

    def __init__(self, state: State, rng: np.random.Generator) -> None:
        self.state, self.rng = state, rng
        self.saturated: dict[str, int] = {}


def _muscles_in(section: Section, path: str = "") -> Iterator[tuple[str, Muscle]]:
    """Yield the muscles of a section of a rig's file and of those inside, by their paths."""
    for name, part in section:
        if isinstance(part, Muscle):
            yield path + name, part
        elif isinstance(part, Section):
            yield from _muscles_in(part, f"{path}{name}.")


def _volumes(traces: Traces) -> dict[str, Array]:
    """Return the volume of every muscle [ml], which no sensor measures."""
    m = traces.room.shape[1]
    return {f"volume_{j + 1}" if m > 1 else "volume": 1e-3 * traces.room[:, j] for j in range(m)}


# -- its file, and the published rig of its name ---------------------------------------------


def load_rig(rig: str | Path | Rig) -> Rig:
    """Return a rig by name, or from a file.

    Parameters
    ----------
    rig : str, path or Rig
        A name of `rig_names`, or a path that ends in ``.toml``; a rig is returned as it is.

    Raises
    ------
    DataError
        On an unknown name, or a file that is not a rig: the text names the parameter and its range.
    """
    if isinstance(rig, Rig):
        return rig
    path = named_toml(rig, PUBLISHED, "rig")
    return _from_fields(fields_of(path), path)


def save_rig(rig: Rig, path: str | Path) -> None:
    """Write a rig as a documented file; an earlier file is replaced when all is written."""
    path = Path(path)
    if path.suffix != ".toml":
        raise DataError("a rig's file ends in .toml", file=path, remedy="name it so")
    write_text(path, describe(rig))


def changes(rig: Rig) -> dict[str, Any] | None:
    """Return the differences of a rig from the published one of its name; None without one.

    >>> changes(load_rig("mas20-hanging").changed({"payload": 10.0}))
    {'payload': 10.0}
    """
    if rig.name not in rig_names():
        return None
    return _differing(_fields(load_rig(rig.name)), _fields(rig))


def recorded_on(recording: Recording) -> Rig | None:
    """Return the rig of a recording, rebuilt; None if it names no published one.

    Raises
    ------
    DataError
        If that was another version, or what was changed is not known or makes no rig.
    """
    rig_name = str(recording.meta.get("rig", ""))
    name, changes = rig_name.partition(" ")[0], recording.meta.get(CHANGES)
    if name not in rig_names():
        return None
    rig = load_rig(name)
    if rig_name != rig.signature:
        raise DataError(
            f"{recording.name} is of {rig_name[:60]}, not of {rig.signature}",
            remedy="record it again, or name the rig",
        )
    if not isinstance(changes, dict):
        raise DataError(
            f"{recording.name} does not record whether its rig {name} was changed",
            remedy="record it again, or name the rig",
        )
    return rig.changed(changes)


def _fields(rig: Rig) -> dict[str, Any]:
    """Return the fields of a rig as JSON values."""
    return rig.model_dump(mode="json", exclude={"title", "source"})


def _differing(
    reference: dict[str, Any], fields_: dict[str, Any], path: str = ""
) -> dict[str, Any]:
    changes: dict[str, Any] = {}
    for name, value in fields_.items():
        before = reference.get(name)
        if isinstance(before, dict) and isinstance(value, dict) and value.keys() == before.keys():
            changes |= _differing(before, value, f"{path}{name}.")
        elif value != before:
            changes[path + name] = value
    return changes


def _from_fields(fields: dict[str, Any], path: Path) -> Rig:
    setups = registry.names("setups")
    setup = fields.get("setup")
    if setup not in setups:
        raise DataError(
            f"setup is {setup!r:.60}", file=path, remedy=f"give one of {', '.join(setups)}"
        )
    model: type[Rig] = registry.load("setups", str(setup))
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        raise invalid(error, path, REMEDY) from None
