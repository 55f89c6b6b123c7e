"""Base class of blocks: immutable parameter sets with dynamics.

A block is one compiled kernel with its coefficients, or composes other blocks. Both kinds *bind*: given
state, input and output arrays they return a function without arguments that runs them, and everything
else here is built on that.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from math import isfinite, nan
from operator import attrgetter
from pathlib import Path
from reprlib import Repr
from textwrap import shorten
from typing import Any, ClassVar, Protocol, Self, overload

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array, Mask
from mckibben.blocks.fields import Channel, Initial, check_units, drives
from mckibben.blocks.kernels import Step, scratch_of
from mckibben.blocks.parameters import Parametrised, gathered, plain
from mckibben.blocks.ranges import (
    REST_SAMPLE_TIME,
    fault_bounds,
    first_known,
    range_over,
    unknown_ranges,
)
from mckibben.blocks.runs import Run, run_of
from mckibben.blocks.sample_times import refuse_time
from mckibben.blocks.starts import explaining_past, stated
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.system.atomic import write_text
from mckibben.system.compiling import bound
from mckibben.system.showing import DrawsItself, Hinted
from mckibben.system.threads import on_all_cores

Advance = Callable[[], None]
Start = Callable[..., None]

FORMAT, VERSION = "mckibben-model", 2
"""First fields of a saved block; see `mckibben.blocks.saving`."""

VIRGIN = {"first_sample": False, "virgin": True}
"""Named start states, and whether a start kernel computes them without past inputs."""

SHORT = Repr()
SHORT.maxother = 100  # characters of a part in the `repr` of a block

Ports = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
"""Names of the channel fields: driven, scheduling and output channels."""

SEVERAL: Ports = ("driven",), ("scheduled",), ("given",)
"""Channel fields of blocks with several channels."""


class Board(Protocol):
    """Signals on which a composition calls blocks; see `mckibben.blocks.compose.Layout`."""

    from_rest: bool

    def call(self, block: Block, taken: Sequence[int]) -> list[int]:
        """Append a block, and return its output signals."""

    def add(self, terms: Sequence[int]) -> int:
        """Append a sum, and return its output signal."""

    def resume(self, state: Sequence[float] | Array) -> None:
        """Set the start state of the blocks called last from their joint state."""


class Block(Hinted, DrawsItself, Parametrised):
    """An immutable parameter set with dynamics.

    Concrete blocks are frozen dataclasses, registered under `kind`. They are independent of data
    and fitting.
    """

    face: ClassVar[str] = "block"

    kernel: ClassVar[Step]
    """Advances one sample, ``kernel(coefficients, state, inputs, outputs)``. A kernel with a
    parameter ``scratch`` after the state receives `n_scratch` numbers of working memory.
    """

    start_kernel: ClassVar[Start | None] = None
    """Fills the state, ``start_kernel(coefficients, state, first inputs, virgin)``, by a named rule."""

    ports: ClassVar[Ports] = ("input",), (), ("output",)
    """Fields of the driven channels, the scheduling channels and the outputs."""

    layout: ClassVar[tuple[str, ...]] = ()
    """Attributes whose numbers the kernel reads, in order; its parameters where none are named."""

    typical: ClassVar[tuple[Any, ...]]
    """Arguments of `example`."""

    rate_dependent: ClassVar[bool] = False
    """Whether the response of blocks of this class depends on the sample time."""

    path_dependent: ClassVar[bool] = False
    """Whether the path of an input between two turning points matters, as for coupled muscles in
    equilibrium.
    """

    of_local_rules: ClassVar[bool] = False
    """Whether the model is a set of local rules, whose output is arbitrary in regions of the joint
    input range without data.
    """

    inverts: ClassVar[bool] = False
    """Whether blocks of this class invert another block, see `forward_model`."""

    no_inverse: ClassVar[str] = "has no exact inverse"
    """Why there is no inverse, if there is none; in the error it follows the kind."""

    instead: ClassVar[str] = "invert a hysteresis model (pi, gpi, mpi, cpi)"
    """The remedy of that error."""

    is_linear: ClassVar[bool] = False
    """Whether outputs are linear in inputs and state, but for constant offsets."""

    filters: ClassVar[bool] = False
    """Whether the block is a linear filter, whose poles may be too slow for single precision."""

    complex_step: ClassVar[bool] = True
    """Whether its free runs are differentiated by complex step: a kernel for complex numbers is compiled
    with it, which of some takes minutes.
    """

    settable: ClassVar[Mapping[str, str | None]] = {}
    """Fields that are not identified and can be set on a saved model: each with the field of the
    lowest and highest value in its identification, or None; see `mckibben.blocks.setting`.
    """

    added: ClassVar[Mapping[str, int]] = {}
    """Fields that files had not from the first: each with the first version of the format that has it.
    They have their defaults where an older file lacks them; whoever adds one raises `VERSION`.
    """

    retired: ClassVar[Mapping[str, Any]] = {}
    """Fields of older files, with the value of each that had no effect. A class that has other fields
    than older files of it makes them of those in ``converted``.
    """

    sample_time: float | None = None
    """Sample time of a discrete block [s]; None if it has no fixed one."""

    samples_ahead: int = 0
    """Preview of the reference that the block needs [samples]."""

    dead_time: float = 0.0
    """Delay of the outputs [s], which the inverse does not compensate."""

    @property
    def title(self) -> str:
        """Title of the block: its kind, and for an inverse also the kind of the inverted block."""
        return self.kind

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        cls.__repr__ = Block.__repr__  # type: ignore[method-assign]  # not the long one of dataclasses

    def __repr__(self) -> str:
        """Return the class and all non-default fields, truncated to three lines."""
        values = [(f, getattr(self, f.name)) for f in dataclasses.fields(self)]  # type: ignore[arg-type]
        changed = [f"{f.name}={SHORT.repr(value)}" for f, value in values if value != f.default]
        return shorten(f"{type(self).__name__}({', '.join(changed)})", 240, placeholder=" ...)")

    # -- channels ----------------------------------------------------------------------------

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Driven inputs, then scheduling inputs."""
        driven, scheduling, _ = self.ports
        return self._channels(*driven, *scheduling)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Names of the scheduling inputs."""
        return tuple(channel.name for channel in self._channels(*self.ports[1]))

    @property
    def n_driven(self) -> int:
        """Number of driven inputs; these come first."""
        return len(self.inputs) - len(self.scheduling)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Outputs."""
        return self._channels(*self.ports[2])

    def _channels(self, *fields: str) -> tuple[Channel, ...]:
        channels: list[Channel] = []
        for field in fields:
            value = attrgetter(field)(self)
            channels += value if isinstance(value, tuple) else [value]
        return tuple(channels)

    def check_channels(self) -> None:
        """Raise an error for repeated channel names, or no channels."""
        for channels in (self.inputs, self.outputs):
            names = [channel.name for channel in channels]
            if not names or len(set(names)) < len(names):
                raise ModelError(
                    f"channels of {self.kind!r} are: {', '.join(names) or 'none'}",
                    remedy="give each a different name",
                )

    @property
    def input_limits(self) -> tuple[float, float]:
        """Lowest and highest input; infinite if the block has no field ``input_range``."""
        ends: tuple[float, float] | None = getattr(self, "input_range", None)
        return (-np.inf, np.inf) if ends is None else ends

    @property
    def free_fields(self) -> Mapping[str, str | None]:
        """Those of `settable` that act on this block."""
        return self.settable

    @cached_property
    def known_inputs(self) -> Array:
        """Lowest and highest identified value of every input, shape (n_inputs, 2).

        Infinite where none is known. Those of a compensator are outputs of the model that it inverts.
        """
        if self._of_model is not None:
            return first_known(self.inputs, self._of_model.known_channels)
        ranges = first_known(self.inputs, self._known_of_parts())
        driven = ranges[: self.n_driven]
        if hasattr(self, "input_range"):
            driven[:] = self.input_limits
        if not np.isfinite(driven).any():
            with suppress(ModelError):
                driven[:] = np.transpose(self.inverse().reachable())
        return ranges

    @property
    def _of_model(self) -> Block | None:
        """The model whose channels the block has in other roles; by default the compensated one."""
        compensates = self.inverts and drives(self.outputs[0]) and not drives(self.inputs[0])
        return self.forward_model if compensates else None

    def _known_of_parts(self) -> list[tuple[tuple[Channel, ...], Array]]:
        """Return channels of parts that are inputs of the block, with their identified ranges."""
        return [(part.inputs, part.known_inputs) for part in getattr(self, "parts", ())]

    @cached_property
    def known_outputs(self) -> Array:
        """Lowest and highest output over the identified inputs, shape (n_outputs, 2).

        Those of a compensator are identified inputs of the model that it inverts.
        """
        if self._of_model is not None:
            return first_known(self.outputs, self._of_model.known_channels)
        timeless = self.rate_dependent and self.sample_time is None
        run = partial(self._run, REST_SAMPLE_TIME if timeless else self.sample_time)
        ranges = range_over(run, self.known_inputs, moving=not timeless)
        return unknown_ranges(len(self.outputs)) if ranges is None else ranges

    @property
    def known_channels(self) -> list[tuple[tuple[Channel, ...], Array]]:
        """The outputs and the inputs with their identified ranges."""
        return [(self.outputs, self.known_outputs), (self.inputs, self.known_inputs)]

    @cached_property
    def input_bounds(self) -> Array:
        """Lowest and highest value of every input that is no fault, shape (n_inputs, 2).

        See `mckibben.blocks.ranges.fault_bounds`.

        Examples
        --------
        >>> from mckibben import PI
        >>> PI.example().input_bounds.tolist()
        [[-5.0, 10.0]]
        """
        return fault_bounds(self.inputs, self.known_inputs)

    @property
    def n_missable(self) -> int:
        """Number of trailing inputs that may be missing (NaN), in streams, C and arrays."""
        return 0

    # -- memory ------------------------------------------------------------------------------
    #
    # On a recording, a block starts (`start_on`) from the first of these that it has:
    # 1. the state that the first outputs give (`known_state`, by `state_at`),
    # 2. the state after inputs that explain the first outputs (`past`),
    # 3. its default start at the first input (`initial_state`, from `start`).
    # Outputs have a say only in a model that starts at rest (`_first_outputs`).

    @property
    def n_states(self) -> int:
        """Length of the state vector, over all parts."""
        return sum(part.n_states for part in getattr(self, "parts", ()))

    @property
    def n_scratch(self) -> int:
        """Length of the working memory of a step, for code that cannot allocate."""
        return sum(part.n_scratch for part in getattr(self, "parts", ()))

    def shares(self, state: Array) -> list[tuple[Any, Array]]:
        """Return every part with its slice of a state, as a view; empty without parts."""
        shares = []
        for part in getattr(self, "parts", ()):
            share, state = np.split(state, [part.n_states])
            shares.append((part, share))
        return shares

    @property
    def start(self) -> Initial:
        """Default start state."""
        return getattr(self, "initial", "first_sample")

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        """Return the state before the first sample, shape (n_states,), a new array.

        Parameters
        ----------
        first : array, shape (n_inputs,)
            The first input sample.
        initial : {"first_sample", "virgin"} or sequence of float, optional
            As if the input had only risen to the first sample; as if nothing had ever happened; or
            the state itself. Default is the block's own.
        """
        start = self.start if initial is None else initial
        if not isinstance(start, str) or start not in VIRGIN:
            return stated(self.kind, self.n_states, start)
        state = np.zeros(self.n_states)
        kernel = self.start_kernel
        if kernel is not None:
            first_inputs = np.ascontiguousarray(first, dtype=np.float64)
            scratch = scratch_of(kernel, self.n_scratch)
            kernel(self.coefficients(sample_time), state, *scratch, first_inputs, VIRGIN[start])
        return state

    def state_at(self, first: Array, output: Array) -> Array | None:
        """Return the equilibrium state for a first input and output; None if outputs do not matter."""
        return None

    def as_run(self, recording: Recording, rows: Mask | None = None, index: int = 0) -> Run:
        """Return a recording as a run of this block, without outputs if it lacks one of them.

        ``rows`` are the samples that count, shape (n,); those bridged in reading never do.
        """
        inputs, outputs = ([c.name for c in some] for some in (self.inputs, self.outputs))
        complete = recording.with_derived([*inputs, *outputs])
        measured = all(complete.units.get(channel.name) == channel.unit for channel in self.outputs)
        return run_of(
            complete,
            inputs[: self.n_driven],
            outputs if measured else (),
            inputs[self.n_driven :],
            ~complete.bridged if rows is None else rows & ~complete.bridged,
            index=index,
        )

    def start_on(self, recording: Recording) -> Array:
        """Return the state before the first sample of a recording; see `mckibben.blocks.starts`."""
        run = self.as_run(recording)
        return self.state_after(self.past(run), run)

    def state_after(self, past: Array, run: Run) -> Array:
        """Return the state after inputs before a run, shape (k, n_inputs).

        That of a block of past outputs is given by the first outputs instead.
        """
        state = self.known_state(run)
        if state is not None:
            return state
        if len(past):
            return self.run(past, run.sample_time, "first_sample")[1]
        return self.initial_state(run.first, sample_time=run.sample_time)

    def known_state(self, run: Run) -> Array | None:
        """Return the state that the first outputs of a run give; None of most blocks."""
        outputs = self._first_outputs(run)
        return None if outputs is None else self.state_at(run.first, outputs)

    def past(self, run: Run) -> Array:
        """Return the inputs before a run that explain its first outputs, shape (k, n_inputs).

        Empty (k = 0) where the block begins at rest at the first input, or as it states.
        """
        outputs = self._first_outputs(run)
        if outputs is None or self.n_driven != 1 or self.state_at(run.first, outputs) is not None:
            return np.empty((0, run.first.size))
        return explaining_past(self, run, outputs)

    def _first_outputs(self, run: Run) -> Array | None:
        """Return the first outputs of a run, from which the block begins; None where they have no say.

        That is where they are not known, or also an input, where the block has no state or states its
        start, and where it is a compensator, whose outputs are commands.
        """
        commands = drives(self.outputs[0]) and not drives(self.inputs[0])
        input_names = {channel.name for channel in self.inputs}
        again = any(channel.name in input_names for channel in self.outputs)
        if commands or again or self.n_states == 0 or not self._starts_at_rest():
            return None
        return run.start

    def _starts_at_rest(self) -> bool:
        """Return whether no part states another start than rest at the first input."""
        parts = getattr(self, "parts", ())
        return self.start == "first_sample" and all(part._starts_at_rest() for part in parts)

    # -- its kernel --------------------------------------------------------------------------

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients of the kernel, one-dimensional; by default those of `layout`.

        Raises
        ------
        ModelError
            If the block has no kernel: it is composed of others, each of which has its own.
        """
        del sample_time
        if getattr(self, "kernel", None) is None:
            raise ModelError(
                f"{self.kind!r} is neither one kernel nor a composition, so it cannot be exported",
                remedy="compose it of blocks",
            )
        return gathered(self, self.layout) if self.layout else self.pack()

    def bind(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Advance:
        """Return a function that runs the block over ``inputs`` into ``outputs``, changing ``state``.

        ``inputs`` has shape (n, n_inputs) and ``outputs`` (n, n_outputs), both C-contiguous; all
        arrays are used in place at every call, so the caller may refill ``inputs`` between calls.
        """
        numbers, kernel = self.coefficients(sample_time), self.kernel
        scratch = scratch_of(kernel, self.n_scratch)
        return bound(kernel.batch, numbers, state, *scratch, inputs, outputs)

    @property
    def c_kernels(self) -> tuple[Callable[..., Any], ...]:
        """Step and start kernels for translation to C."""
        step, start = getattr(self, "kernel", None), self.start_kernel
        if step is None or (self.n_states and start is None):
            return ()
        return (step, start) if self.n_states and start is not None else (step,)

    def strictly_increasing(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        """Yield name and values of every `increasing` field."""
        for name in self.increasing:
            yield name, getattr(self, name)

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        """Add the block to a layout of signals, and return its output signals."""
        return board.call(self, taken)

    def inverse(self) -> Block:
        """Return the inverse of this block; raise a `ModelError` if there is none."""
        raise ModelError(f"{self.kind!r} {self.no_inverse}", remedy=self.instead)

    @property
    def forward_model(self) -> Block | None:
        """The model that a compensator inverts; None if it inverts none, such as feedback alone."""
        try:
            return self.inverse()
        except ModelError:
            return None

    def reachable(self) -> tuple[Array, Array]:
        """Return the lowest and highest outputs that are reachable from every state.

        Each has shape (n_outputs,); by default they are infinite.
        """
        n = len(self.outputs)
        return np.full(n, -np.inf), np.full(n, np.inf)

    def passes(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the output range for an input range.

        A block without memory must be monotone; one with memory answers with its own `reachable`.
        """
        if self.n_states == 0 and not self.scheduling and np.isfinite([*low, *high]).all():
            first, second = np.sort(self.simulate(np.array([low, high])), axis=0)
            return first, second
        return self.reachable()

    @classmethod
    def example(cls) -> Self:
        """Return a small typical block of this class, for documentation and contract tests."""
        return cls(*cls.typical)

    # -- running -----------------------------------------------------------------------------

    @overload
    def simulate(
        self, data: Recording, *, initial: Initial | None = None, sample_time: float | None = None
    ) -> Recording: ...

    @overload
    def simulate(
        self, data: ArrayLike, *, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array: ...

    def simulate(
        self,
        data: Recording | ArrayLike,
        *,
        initial: Initial | None = None,
        sample_time: float | None = None,
    ) -> Recording | Array:
        """Simulate the block (free-running) on a recording or an array of inputs.

        Parameters
        ----------
        data : Recording or array_like, shape (n,) or (n, n_inputs)
            A recording needs a channel for every input.
        initial : {"first_sample", "virgin"} or sequence of float, optional
            Memory before the first sample. Default: of a recording that has the outputs, what the first
            of these determines, the rest at rest (see `mckibben.blocks.starts`); of one that is a
            period of a motion, that of the periodic response; else the block's own.
        sample_time : float, optional
            Time between samples [s]; for arrays of a rate-dependent block only.

        Returns
        -------
        Recording or array
            The same kind: a recording of the inputs and the modelled outputs, or an array of shape
            (n, n_outputs), or (n,) for one output from a one-dimensional input.

        Raises
        ------
        DataError
            On absent channels, wrong units or shapes, or values that are not finite.
        ModelError
            If the block is rate-dependent and the data have no time.
        """
        if isinstance(data, Recording):
            inputs = self._inputs_from(data)
            if initial is None and data.periodic:
                return self.steady_state(data)
            if initial is None:
                initial = self.start_on(data).tolist()
            outputs = self._run(data.sample_time, inputs, initial)
            return self._modelled(data, outputs)
        try:
            array = np.asarray(data, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise DataError(
                f"the inputs cannot be used ({error})",
                remedy="give a recording or an array of numbers",
            ) from None
        outputs = self._run(sample_time, self._inputs_from_array(array), initial)
        return outputs[:, 0] if array.ndim == 1 and outputs.shape[1] == 1 else outputs

    def steady_state(self, recording: Recording) -> Recording:
        """Return the response to one period of a motion that repeats: at least the second."""
        inputs = self._inputs_from(recording)
        twice = self._run(recording.sample_time, np.tile(inputs, (2, 1)), None)
        return self._modelled(recording, twice[len(inputs) :])

    def stream(self, sample_time: float | None = None, *, initial: Initial | None = None) -> Stream:
        """Return a stepper for sample-by-sample use; see `Stream`."""
        return Stream(self, sample_time, initial)

    def simulate_many(
        self,
        parameters: ArrayLike,
        data: ArrayLike,
        *,
        initial: Initial | None = None,
        sample_time: float | None = None,
    ) -> Array:
        """Simulate many parameter sets of this structure on the same inputs, on all cores.

        Parameters
        ----------
        parameters : array_like, shape (k, n_parameters)
            One set a row, as `pack` gives them.
        data : array_like, shape (n,) or (n, n_inputs)
            Inputs.
        initial, sample_time
            As for `simulate`.

        Returns
        -------
        array, shape (k, n), or (k, n, n_outputs) for several outputs
        """
        blocks = [self.unpack(row) for row in np.atleast_2d(parameters)]
        inputs = self._inputs_from_array(np.asarray(data, dtype=np.float64))
        outputs = run_many(blocks, inputs, sample_time=sample_time, initial=initial)
        return outputs[:, :, 0] if outputs.shape[2] == 1 else outputs

    def final_state(self, data: Recording, *, initial: Initial | None = None) -> Array:
        """Return the state after a recording, shape (n_states,), to start the next one from."""
        start = self.start_on(data).tolist() if initial is None else initial
        return self.run(self._inputs_from(data), data.sample_time, start)[1]

    def run(
        self, inputs: Array, sample_time: float | None, initial: Initial | None
    ) -> tuple[Array, Array]:
        """Return the outputs over inputs, (n, n_inputs), and the final state, without any checks."""
        state = self.initial_state(inputs[0], initial, sample_time)
        outputs = np.empty((len(inputs), len(self.outputs)))
        self.bind(sample_time, state, np.ascontiguousarray(inputs), outputs)()
        return outputs, state

    def _run(self, sample_time: float | None, inputs: Array, initial: Initial | None) -> Array:
        refuse_time(sample_time)
        self.check_time(sample_time)
        outputs, state = self.run(inputs, sample_time, initial)
        self.report(state)
        return outputs

    def _modelled(self, recording: Recording, outputs: Array) -> Recording:
        """Return the inputs of a recording and outputs, (n, n_outputs), which must be finite."""
        if not np.isfinite(outputs).all():
            raise ModelError(
                f"the output of {self.kind!r} is not finite on {recording.name}",
                remedy="this model does not suit this recording; identify it again",
            )
        units = {channel.name: channel.unit for channel in self.outputs}
        modelled = dict(zip(units, outputs.T, strict=True))
        inputs = recording.select([channel.name for channel in self.inputs])
        return inputs.with_channels(units, **modelled)

    def check_time(self, sample_time: float | None) -> None:
        """Warn if the sample time changes the model or one of its parts."""
        for part in getattr(self, "parts", ()):
            part.check_time(sample_time)

    def report(self, state: Array) -> None:
        """Warn about events of a run, such as clipping, recorded in its final state."""
        for part, share in self.shares(state):
            part.report(share)

    @property
    def clip_counts(self) -> tuple[int, ...]:
        """Places in the state that count samples that were clipped, or not solved."""
        shares = self.shares(np.arange(self.n_states, dtype=np.float64))
        return tuple(int(share[index]) for part, share in shares for index in part.clip_counts)

    def n_clipped(self, state: Array) -> int:
        """Return the number of samples that were clipped, or not solved, from the final state."""
        return int(sum(max(state[index], 0.0) for index in self.clip_counts))

    def _inputs_from(self, recording: Recording) -> Array:
        check_units(recording, self.inputs)
        return np.ascontiguousarray(recording.matrix(channel.name for channel in self.inputs))

    def _inputs_from_array(self, array: Array) -> Array:
        n_inputs = len(self.inputs)
        table = array[:, np.newaxis] if array.ndim == 1 else array
        if table.ndim != 2 or table.shape[1] != n_inputs or table.shape[0] == 0:
            raise DataError(
                f"inputs have shape {array.shape}, but {self.kind!r} has {n_inputs} input(s)",
                remedy=f"give an array of shape (n, {n_inputs})"
                + (" or (n,)" if n_inputs == 1 else ""),
            )
        finite = np.isfinite(table)
        finite[:, n_inputs - self.n_missable :] = True
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise DataError(
                f"the input is {table[row, column]}",
                channel=self.inputs[column].name,
                row=int(row) + 1,
                remedy="remove or interpolate samples that are not finite",
            )
        return np.ascontiguousarray(table)

    # -- saving ------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Return the block as a JSON-ready dict, exact to the last bit."""
        return {"format": FORMAT, "version": VERSION, **plain(self)}

    def to_text(self) -> str:
        """Return the block as the text of its file."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Save the block as readable JSON, written as a whole; see `mckibben.load`."""
        write_text(path, self.to_text())


class Stream:
    """A block running sample by sample.

    An input that is NaN, infinite, or beyond what it was identified for with a margin
    (`Block.input_bounds`) is a fault: the last good value of that input is held, and
    the block steps on with it, so that the fault never reaches memory. A measurement that may be
    missing is then missing. Before every input has had a good value, nothing happens and outputs are 0.
    Outputs are always finite: where one would not be, they are those of the last good step, and memory
    that is lost starts afresh at the next. Exported C does the same.

    Parameters
    ----------
    block : Block
        What runs.
    sample_time : float, optional
        Time between steps [s]; needed by rate-dependent blocks.
    initial : {"first_sample", "virgin"} or sequence of float, optional
        Memory before the first step; default is the block's own.

    Attributes
    ----------
    state : array, shape (n_states,)
        Memory; of no meaning before the first step.
    status : int
        Of the last step: `GOOD`, or a sum of `BAD_INPUT`, an input was held; `BAD_OUTPUT`, the outputs
        were; and `CLIPPED`, what was asked for is out of reach.
    """

    GOOD, BAD_INPUT, BAD_OUTPUT, CLIPPED = 0, 1, 2, 4

    def __init__(
        self, block: Block, sample_time: float | None = None, initial: Initial | None = None
    ) -> None:
        self.block, self.sample_time, self.initial = block, sample_time, initial
        inputs, outputs = np.zeros((1, len(block.inputs))), np.zeros((1, len(block.outputs)))
        self.state = np.zeros(block.n_states)
        refuse_time(sample_time)
        block.check_time(sample_time)
        self._run = block.bind(sample_time, self.state, inputs, outputs)
        self._input, self._output = inputs[0], outputs[0]
        # Python's own numbers are faster than arrays so small
        self._given, self._gives = _scalars(self._input), _scalars(self._output)
        self._needed = self._input.size - block.n_missable
        self._one_given, self._one_gives = self._input.size == 1, self._output.size == 1
        self._bounds: list[tuple[float, float]] = [(a, b) for a, b in block.input_bounds.tolist()]
        self._counts, self._counted = block.clip_counts, _scalars(self.state)
        self.reset()

    def reset(self) -> None:
        """Reset to the initial state."""
        self._started, self._clipped = False, 0.0
        self._last = [nan] * self._input.size
        self._kept: float | list[float] = 0.0
        self.status = self.GOOD

    def step(self, inputs: float | ArrayLike) -> Array:
        """Take one sample of every input and return the outputs, shape (n_outputs,).

        The array returned is reused by the next step: copy what you keep.
        """
        given, gives = self._given, self._gives
        if self._one_given and isinstance(inputs, float):  # also NumPy's
            given[0] = inputs
        else:
            try:
                self._input[...] = inputs
            except (TypeError, ValueError, OverflowError) as error:
                raise self._misfit(error) from None
            if not self._one_given and np.size(inputs) != self._input.size:  # spread, not given
                raise self._misfit(ValueError(f"{np.size(inputs)} number(s)"))
        status, last = self.GOOD, self._last
        for k, (low, high) in enumerate(self._bounds):
            value = given[k]
            if low <= value <= high:
                last[k] = value
            elif k >= self._needed:  # missing
                status |= self.BAD_INPUT * (value == value)
                given[k] = nan
            else:
                status |= self.BAD_INPUT
                given[k] = last[k]
        if status and not all(map(isfinite, last[: self._needed])):
            return self._held(status)
        if not self._started:
            self.state[:] = self.block.initial_state(self._input, self.initial, self.sample_time)
            self._clipped = sum(map(self._counted.__getitem__, self._counts))
            self._started = True
        self._run()
        if self._counts:
            clipped = sum(map(self._counted.__getitem__, self._counts))
            if clipped > self._clipped:
                status |= self.CLIPPED
            self._clipped = clipped
        output: Any = gives[0] if self._one_gives else gives.tolist()
        # a sum is finite only if all terms are; it may overflow, and infinity less itself is NaN
        total = output if self._one_gives else sum(output)
        if total - total and not all(map(isfinite, gives)):
            if not np.isfinite(self.state).all():
                self._started = False
            return self._held(status | self.BAD_OUTPUT)
        self._kept = output
        self.status = status
        return self._output

    def _held(self, status: int) -> Array:
        self.status = status
        self._output[...] = self._kept
        return self._output

    def _misfit(self, error: Exception) -> DataError:
        names = ", ".join(channel.name for channel in self.block.inputs)
        return DataError(
            f"a step cannot take these inputs ({error})", remedy=f"give one number each: {names}"
        )


def _scalars(array: Array) -> memoryview[float]:
    return array.data.cast("B").cast("d")


def run_many(
    blocks: Sequence[Block],
    inputs: Array,
    *,
    sample_time: float | None = None,
    initial: Initial | None = None,
) -> Array:
    """Return outputs of blocks with the same channels, shape (blocks, n, n_outputs), on all cores."""
    refuse_time(sample_time)
    outputs = np.empty((len(blocks), inputs.shape[0], len(blocks[0].outputs)))

    def run(index: int) -> None:
        state = blocks[index].initial_state(inputs[0], initial, sample_time)
        blocks[index].bind(sample_time, state, inputs, outputs[index])()

    on_all_cores(run, len(blocks))
    return outputs
