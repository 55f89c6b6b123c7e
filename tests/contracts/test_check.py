"""check_block catches what it is there to catch: one broken block for every law."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import (
    PI,
    Block,
    DataError,
    ModelError,
    Play,
    RateDependentPI,
    check_block,
)
from mckibben.blocks.core import saving
from mckibben.blocks.core.inverse import Inverse
from mckibben.blocks.core.running import Stream
from mckibben.blocks.laws.check import LAWS
from mckibben.errors import ContractError

Array = NDArray[np.float64]
Patch = Callable[[pytest.MonkeyPatch], None]

ticks = itertools.count()


def replaced(cls: type, name: str, make: Callable[[Any], Any]) -> Patch:
    """Return a patch that replaces a member of a class by one made from the original."""

    def patch(monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(cls, name, make(getattr(cls, name)))

    return patch


def after(change: Callable[..., Any]) -> Callable[[Any], Any]:
    """Make a method that gives what the original gives, changed."""
    return lambda original: lambda self, *a, **k: change(original(self, *a, **k))


def spoiled_input(original: Any) -> Any:
    def run(self: Block, inputs: Array, *rest: Any) -> Array:
        outputs: Array = original(self, inputs, *rest)
        inputs[-1] += 1.0
        return outputs

    return run


def spoiled_state(original: Any) -> Any:
    def simulate(self: Block, data: Any, *, initial: Any = None, **k: Any) -> Any:
        outputs = original(self, data, initial=initial, **k)
        if isinstance(initial, list):
            initial[0] += 1.0
        return outputs

    return simulate


def holds_still(original: Any) -> Any:
    """Make an inverse start that ignores the state handed to it."""
    return lambda self, first, initial=None: original(self, first, None)


def timed(original: Any) -> Any:
    def coefficients(self: PI, sample_time: float | None) -> Array:
        found: Array = original(self, sample_time).copy()
        found[0] += 1e-9 * (sample_time or 0.0)
        return found

    return coefficients


BROKEN: dict[str, tuple[Patch, str]] = {
    "a wrong number of parameters": (
        replaced(PI, "n_parameters", lambda p: property(lambda self: len(self.weights))),
        "sizes_agree",
    ),
    "a wrong number of states": (
        replaced(PI, "initial_state", after(lambda s: np.append(s, 0.0))),
        "sizes_agree",
    ),
    "unpack that forgets": (
        replaced(PI, "unpack", lambda _: lambda self, p: PI((0.0,), (1.0,))),
        "sizes_agree",
    ),
    "parameter vectors of any length": (
        replaced(PI, "unpack", lambda original: lambda self, p: original(self, p[:5])),
        "sizes_agree",
    ),
    "outputs of another shape": (
        replaced(PI, "_run", after(lambda y: np.column_stack([y, y]))),
        "simulates",
    ),
    "outputs that are not finite": (
        replaced(PI, "_run", after(lambda y: np.full_like(y, np.nan))),
        "simulates",
    ),
    "inputs that change": (replaced(PI, "_run", spoiled_input), "simulates"),
    "states that change": (replaced(PI, "simulate", spoiled_state), "simulates"),
    "chance": (replaced(PI, "_run", after(lambda y: y + 1e-12 * next(ticks))), "simulates"),
    "a stream that differs by a bit": (
        replaced(Stream, "step", after(lambda y: np.nextafter(y, np.inf))),
        "streams",
    ),
    "reset that does nothing": (
        replaced(Stream, "reset", lambda _: lambda self: setattr(self, "_started", True)),
        "streams",
    ),
    "a stream deaf to states": (
        replaced(
            PI, "stream", lambda original: lambda self, step, initial=None: original(self, step)
        ),
        "streams",
    ),
    "simulate_many that mixes rows": (
        replaced(PI, "simulate_many", after(lambda y: y[::-1])),
        "simulates_many",
    ),
    "saving that rounds": (
        replaced(
            PI,
            "to_dict",
            lambda original: lambda self: original(self) | {"offset": self.offset + 1e-12},
        ),
        "saves",
    ),
    "loading that takes anything": (
        lambda monkeypatch: monkeypatch.setattr(saving, "from_dict", lambda content: PI.example()),
        "saves",
    ),
    "recordings with other outputs": (
        replaced(PI, "_inputs_from", after(lambda inputs: inputs + 1e-9)),
        "takes_recordings",
    ),
    "arrays with NaN": (
        replaced(
            PI,
            "_inputs_from_array",
            lambda original: lambda self, a: original(self, np.nan_to_num(a)),
        ),
        "refuses_bad_arrays",
    ),
    "errors without a remedy": (
        replaced(DataError, "__str__", lambda _: lambda self: f"{self.channel}: {self.problem}"),
        "takes_recordings",
    ),
    "outputs that depend on the sample time": (
        replaced(PI, "coefficients", timed),
        "knows_its_time",
    ),
    "a missing remedy": (
        replaced(PI, "inverse", lambda _: lambda self: (_ for _ in ()).throw(ModelError("no"))),
        "inverts",
    ),
    "an inverse with other channels": (
        replaced(PI, "inverse", lambda _: lambda self: Play(0.1)),
        "inverts",
    ),
    "an inverse of another model": (
        replaced(
            PI, "inverse", lambda original: lambda self: original(self.unpack(1.01 * self.pack()))
        ),
        "inverts",
    ),
    "an inverse that is a little off": (
        replaced(Inverse, "_run", after(lambda u: u * (1 + 1e-8))),
        "inverts",
    ),
    "an inverse deaf to states": (replaced(Inverse, "initial_state", holds_still), "inverts"),
    "clipping in silence": (
        replaced(Inverse, "report", lambda _: lambda self, state: None),
        "inverts",
    ),
}


def first_broken(block: Block) -> str:
    """Return the name of the law that `check_block` finds broken."""
    with pytest.raises(ContractError, match=f"'{block.kind}'.*Remedy:") as caught:
        check_block(block)
    frames = {frame.name.removeprefix("_") for frame in caught.traceback}
    (law,) = frames & {law.__name__.removeprefix("_") for law in LAWS}
    return law


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_blocks_are_caught(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    patch, law = BROKEN[fault]
    check_block(PI.example())
    patch(monkeypatch)
    assert first_broken(PI.example()) == law


@pytest.mark.parametrize("hidden", [False, True])
def test_a_block_whose_rate_counts_and_that_does_not_say_so_is_caught(
    hidden: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It takes every sample for the same time, or does not ask for the time that it needs."""
    original = RateDependentPI.coefficients
    if hidden:
        monkeypatch.setattr(RateDependentPI, "rate_dependent", False)
    monkeypatch.setattr(
        RateDependentPI, "coefficients", lambda self, step: original(self, step or 0.1)
    )
    assert first_broken(RateDependentPI.example()) == "knows_its_time"


def test_a_block_of_hidden_rate_in_steps_of_one_time_is_caught(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    original = RateDependentPI.coefficients
    monkeypatch.setattr(RateDependentPI, "rate_dependent", False)
    monkeypatch.setattr(RateDependentPI, "coefficients", lambda self, step: original(self, 0.1))
    assert first_broken(RateDependentPI.example()) == "knows_its_time"
