"""What `fit`, `predict` and `score` are given: recordings, data frames or arrays, made recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from numbers import Real
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording, is_frame, listed


@dataclass(frozen=True, eq=False)
class Outputs(Sequence[Array]):
    """Outputs of several recordings: one array, shape (n,) or (n, m), a recording.

    Functions of NumPy take it as one array, of all samples in order; but `numpy.concatenate` of several
    joins these. So scikit-learn splits it by recording, and scores it by sample.
    """

    every: tuple[Array, ...]

    @property
    def shape(self) -> tuple[int]:
        """Number of recordings, by which scikit-learn indexes it as an array."""
        return (len(self),)

    def __len__(self) -> int:
        return len(self.every)

    def __getitem__(self, index: Any) -> Any:
        """Return the outputs of one recording, or of those that a slice or an array selects."""
        first = index[0] if isinstance(index, tuple) else index  # (selected, ...) of scikit-learn
        places = np.arange(len(self))[first]
        return Outputs(tuple(self.every[k] for k in places)) if places.ndim else self.every[places]

    def __array__(self, dtype: DTypeLike = None, copy: bool | None = None) -> Array:
        return np.concatenate(self.every).astype(np.float64 if dtype is None else dtype)

    def __array_function__(
        self,
        function: Callable[..., Any],
        types: Any,
        args: Sequence[Any],
        keywords: Mapping[str, Any],
    ) -> Any:
        if function is np.concatenate and all(isinstance(one, Outputs) for one in args[0]):
            return Outputs(tuple(chain.from_iterable(args[0])))
        if not any(isinstance(one, Outputs) for one in args):  # but inside one, or by name
            return NotImplemented
        return function(*(np.asarray(a) if isinstance(a, Outputs) else a for a in args), **keywords)


def squeezed(outputs: Array) -> Array:
    """Return outputs, shape (n, m), as scikit-learn has them: (n,) of one."""
    return outputs[:, 0] if outputs.shape[1] == 1 else outputs


def is_array(data: object) -> bool:
    """Return whether this is a table of numbers whose columns have no names."""
    if isinstance(data, Recording):
        return False
    if is_frame(data):
        return not is_named(data)
    if isinstance(data, list | tuple):
        return len(data) > 0 and isinstance(data[0], Real | list | tuple)
    return hasattr(data, "__array__") or hasattr(data, "toarray")


def is_named(data: object) -> bool:
    """Return whether this is a data frame whose columns have names."""
    return is_frame(data) and all(isinstance(name, str) for name in getattr(data, "columns", ()))


def recorded(
    data: Any,
    inputs: Sequence[str] | None,
    y: Any,
    outputs: Sequence[str] | None,
    sample_time: float | None,
    owner: str,
) -> list[Recording]:
    """Return recordings as a list, with the outputs ``y`` if given; or arrays as one recording.

    Parameters
    ----------
    given : recording, data frame, sequence of these, or array
    inputs, outputs : sequence of str, optional
        Channels of the columns of arrays; by default pressures and displacements.
    y : array, data frame, or sequence of these, optional
        Outputs: of a recording, or of each in a sequence.
    sample_time : float, optional
        Between samples of arrays, or of frames without time [s].
    owner : str
        The estimator, for errors.

    Raises
    ------
    DataError
        On arrays that are not of these channels, or not of these recordings.
    """
    if is_array(data):
        columns = by_channel(data, inputs, "X", owner)
        if y is not None:
            columns |= by_channel(y, outputs, "y", owner)
        return [Recording(columns, sample_time)]
    runs = [timed(one, sample_time) for one in listed(data)]
    if y is None:
        return runs
    parts = [y] if isinstance(data, Recording) or is_frame(data) else list(y)
    if len(parts) != len(runs):
        raise DataError(
            f"there are {len(runs)} recordings and outputs of {len(parts)}",
            remedy="give one array a recording",
        )
    return [
        one.with_channels(**by_channel(part, outputs, "y", owner))
        for one, part in zip(runs, parts, strict=True)
    ]


def require_outputs(data: Any, y: Any, owner: str) -> None:
    """Raise a `DataError` if inputs are an array, and there are no outputs."""
    if y is None and is_array(data):
        raise DataError(
            f"{owner} of an array requires y to be passed, but the target y is None",
            remedy="give the outputs as the second argument, or make a recording of both by "
            "mckibben.Recording({'pressure': u, 'displacement': y}, sample_time)",
        )


def timed(recording: Recording, sample_time: float | None) -> Recording:
    """Return a recording with this time between samples; it has no other."""
    if sample_time in (None, recording.sample_time):
        return recording
    if recording.sample_time is not None:
        raise DataError(
            f"the recording has a sample time, {recording.sample_time:g} s",
            file=recording.source,
            parameter="sample_time",
            remedy="leave it out, it is for arrays",
        )
    return replace(recording, sample_time=sample_time)


def by_channel(
    data: Any, names: Sequence[str] | None, side: Literal["X", "y"], owner: str
) -> dict[str, Array]:
    """Return an array or a frame of one side of the data by channel.

    Parameters
    ----------
    given : array, shape (n,) or (n, channels), or frame
        Columns of a frame are found by their names, if they have any.
    names : sequence of str, optional
        The channels, by default as many pressures or displacements as there are columns.
    side : {"X", "y"}
        Inputs or outputs.
    owner : str
        The estimator, for errors.

    Raises
    ------
    DataError
        On complex, sparse, infinite and absent values, and on other than one column a channel.
    TypeError, ValueError
        On objects and texts that are no numbers.
    """
    if is_named(data):
        frame = Recording.from_frame(data)
        return {name: frame[name] for name in names or frame.channels}
    if hasattr(data, "toarray"):
        raise DataError("sparse data were passed", remedy="give a dense array: X.toarray()")
    table = data if isinstance(data, np.ndarray) else np.asarray(data)
    if table.dtype.kind in "cmM":
        kind = "Complex" if table.dtype.kind == "c" else table.dtype.name
        raise DataError(f"{kind} data not supported", remedy="give real numbers")
    table = table.astype(np.float64)
    if table.ndim not in (1, 2) or 0 in table.shape[1:]:
        raise DataError(
            f"{side} has {table.shape[-1] if table.ndim else 0} feature(s) (shape={table.shape}) "
            "while a minimum of 1 is required",
            remedy="give one row a sample and one column a channel",
        )
    if not np.isfinite(table).all():
        row = int(np.argwhere(~np.isfinite(table))[0, 0]) + 1
        raise DataError(f"{side} has NaN or inf", row=row, remedy="leave those samples out")
    n = 1 if table.ndim == 1 else table.shape[1]
    quantity = "pressure" if side == "X" else "displacement"
    channels = names or ([f"{quantity}_{k + 1}" for k in range(n)] if n > 1 else [quantity])
    if n != len(channels):
        needed = f"one column for each of {', '.join(channels)}"
        if table.ndim == 1:
            problem = f"{side} is one-dimensional, and {owner} has {len(channels)} such channels"
            raise DataError(problem, remedy=f"Reshape your data: {needed}")
        what = "features as input" if side == "X" else "outputs"
        problem = (
            f"{side} has {n} {what.split()[0]}, but {owner} is expecting {len(channels)} {what}"
        )
        raise DataError(problem, remedy=f"give {needed}, or a data frame with these names")
    return dict(zip(channels, np.atleast_2d(table.T), strict=True))
