"""check_block catches what it is there to catch: one broken block for every law."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import (
    EUPI,
    GPI,
    PI,
    Affine,
    Block,
    DataError,
    ModelError,
    Play,
    Polynomial,
    RateDependentPI,
    Series,
    check_block,
)
from mckibben.blocks.core import saving
from mckibben.blocks.core.fields import vector
from mckibben.blocks.core.inverse import Inverse
from mckibben.blocks.core.running import Stream
from mckibben.blocks.play_type.envelopes.exponential import Exponential
from mckibben.blocks.play_type.envelopes.tanh import Tanh
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
        "n_parameters|unpack",
    ),
    "a wrong number of states": (
        replaced(PI, "initial_state", after(lambda s: np.append(s, 0.0))),
        "n_states",
    ),
    "unpack that forgets": (
        replaced(PI, "unpack", lambda _: lambda self, p: PI((0.0,), (1.0,))),
        "unpack",
    ),
    "parameter vectors of any length": (
        replaced(PI, "unpack", lambda original: lambda self, p: original(self, p[:5])),
        "bad input raises a ModelError",
    ),
    "outputs of another shape": (
        replaced(PI, "_run", after(lambda y: np.column_stack([y, y]))),
        "one column to every output",
    ),
    "outputs that are not finite": (
        replaced(PI, "_run", after(lambda y: np.full_like(y, np.nan))),
        "finite",
    ),
    "inputs that change": (replaced(PI, "_run", spoiled_input), "inputs alone"),
    "states that change": (replaced(PI, "simulate", spoiled_state), "state it is given"),
    "chance": (
        replaced(PI, "_run", after(lambda y: y + 1e-15 * next(ticks) * 1e3)),
        "simulating again",
    ),
    "a stream that differs by a bit": (
        replaced(Stream, "step", after(lambda y: np.nextafter(y, np.inf))),
        "stream equals simulate",
    ),
    "reset that does nothing": (
        replaced(Stream, "reset", lambda _: lambda self: setattr(self, "_started", True)),
        "stream equals simulate",
    ),
    "a stream deaf to states": (
        replaced(
            PI, "stream", lambda original: lambda self, step, initial=None: original(self, step)
        ),
        "explicit state",
    ),
    "simulate_many that mixes rows": (
        replaced(PI, "simulate_many", after(lambda y: y[::-1])),
        "simulate_many",
    ),
    "saving that rounds": (
        replaced(
            PI,
            "to_dict",
            lambda original: lambda self: original(self) | {"offset": self.offset + 1e-12},
        ),
        "saved and loaded copy",
    ),
    "loading that takes anything": (
        lambda monkeypatch: monkeypatch.setattr(saving, "from_dict", lambda content: PI.example()),
        "surplus",
    ),
    "recordings with other outputs": (
        replaced(PI, "_inputs_from", after(lambda inputs: inputs + 1e-9)),
        "recording gives",
    ),
    "arrays with NaN": (
        replaced(
            PI,
            "_inputs_from_array",
            lambda original: lambda self, a: original(self, np.nan_to_num(a)),
        ),
        "bad input raises a DataError",
    ),
    "errors without a remedy": (
        replaced(DataError, "__str__", lambda _: lambda self: f"{self.channel}: {self.problem}"),
        "remedy",
    ),
    "outputs that depend on the sample time": (
        replaced(PI, "coefficients", timed),
        "any sample time|simulate",
    ),
    "a missing remedy": (
        replaced(PI, "inverse", lambda _: lambda self: (_ for _ in ()).throw(ModelError("no"))),
        "inverse.. ends with a remedy",
    ),
    "an inverse with other channels": (
        replaced(PI, "inverse", lambda _: lambda self: Play(0.1)),
        "takes the outputs",
    ),
    "an inverse of another model": (
        replaced(
            PI, "inverse", lambda original: lambda self: original(self.unpack(1.01 * self.pack()))
        ),
        "inverse of the inverse",
    ),
    "an inverse that is a little off": (
        replaced(Inverse, "_run", after(lambda u: u * (1 + 1e-8))),
        "forward of inverse",
    ),
    "an inverse deaf to states": (
        replaced(Inverse, "initial_state", holds_still),
        "carried-over state",
    ),
    "clipping in silence": (
        replaced(Inverse, "report", lambda _: lambda self, state: None),
        "warns",
    ),
}


def test_the_plain_block_passes() -> None:
    check_block(PI.example())


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_blocks_are_caught(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    patch, law = BROKEN[fault]
    patch(monkeypatch)
    with pytest.raises(ContractError, match=rf"'pi' breaks the contract.*({law}).*Remedy:"):
        check_block(PI.example())


def test_a_rate_dependent_block_must_ask_for_time(monkeypatch: pytest.MonkeyPatch) -> None:
    original = RateDependentPI.coefficients
    monkeypatch.setattr(
        RateDependentPI, "coefficients", lambda self, step: original(self, step or 0.1)
    )
    with pytest.raises(ContractError, match="sample time"):
        check_block(RateDependentPI.example())


@pytest.mark.parametrize(
    ("step", "law"), [(None, "any sample time"), (0.1, "holding the input|turning points")]
)
def test_a_block_that_hides_its_rate_dependence_is_caught(
    step: float | None, law: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once it follows the sample time, once it takes every sample for the same time."""
    original = RateDependentPI.coefficients
    monkeypatch.setattr(RateDependentPI, "rate_dependent", False)
    monkeypatch.setattr(
        RateDependentPI, "coefficients", lambda self, given: original(self, step or given or 0.1)
    )
    with pytest.raises(ContractError, match=law):
        check_block(RateDependentPI.example())


@pytest.mark.parametrize(
    "block",
    [
        PI((0.0, 0.5, 1.0), (3.0, -1.0, -1.0), -2.0, (1.0, 4.0)),
        PI((0.2, 0.5), (1.0, 1.0)),
        PI((0.0, 0.5), (1.0, 1.0)),
        PI((0.0, 0.5), (1.0, 1.0), initial=(0.3, 0.2)),
        PI((0.0, 0.3), (1.0, 1.0), 1e6, (0.0, 5.0)),
        PI(vector(np.linspace(0.0, 2.4, 200)), (1.0,) * 200, 0.0, (0.0, 5.0)),
        GPI((0.0, 0.2), (3.0, 1.0), Tanh(10.0, -25.0), Tanh(10.0, -22.0), (0.0, 5.0)),
        GPI((0.0, 0.2), (3.0, 1.0), Tanh(1e-6, 0.0), Tanh(1e-6, 0.0, 1e-7), (0.0, 5.0)),
        GPI((0.0, 0.2), (3.0, 1.0), Exponential(5.0, 0.0), Exponential(5.0, 0.0, 0.1), (0.0, 5.0)),
        EUPI((0.0, 0.3), (1.0, 1.0), 0.9, 1.5, (0.0, 0.0, 0.0), 0.0, (0.0, 5.0)),
        Series((PI.example(), Affine(-2.0, 3.0))),
        Polynomial((0.0, 1.0, -3.0)),
        Play(0.0),
        RateDependentPI((0.0,), (0.01,), (1.0,), 0.0, 0.5, (-2.0, 2.0)),
    ],
)
def test_unusual_blocks_pass(block: Block) -> None:
    for seed in range(3):
        check_block(block, seed=seed)
