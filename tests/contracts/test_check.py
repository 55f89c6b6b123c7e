"""check_block catches what it is there to catch: one broken block for every law."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import PI, Block, RateDependentPI, check_block
from mckibben.blocks.base import Stream
from mckibben.blocks.inverse import Inverse
from mckibben.blocks.laws import LAWS
from mckibben.errors import ContractError

Array = NDArray[np.float64]
Make = Callable[[Any], Any]


def after(change: Callable[..., Any]) -> Make:
    """Make a method that gives what the original gives, changed."""
    return lambda original: lambda self, *a, **k: change(original(self, *a, **k))


def instead(member: Any) -> Make:
    return lambda original: member


def spoiled_input(original: Any) -> Any:
    def run(self: Block, sample_time: float | None, inputs: Array, *rest: Any) -> Array:
        outputs: Array = original(self, sample_time, inputs, *rest)
        inputs[-1] += 1.0
        return outputs

    return run


def timed(original: Any) -> Any:
    def coefficients(self: PI, sample_time: float | None) -> Array:
        found: Array = original(self, sample_time).copy()
        found[0] += 1e-9 * (sample_time or 0.0)
        return found

    return coefficients


def rounded(original: Any) -> Any:
    return lambda self: original(self) | {"offset": self.offset + 1e-12}


BROKEN: dict[str, tuple[Any, str, Make]] = {
    "sizes_agree: a wrong number of parameters": (
        PI,
        "n_parameters",
        instead(property(lambda self: len(self.weights))),
    ),
    "sizes_agree: a wrong number of states": (
        PI,
        "initial_state",
        after(lambda s: np.append(s, 0.0)),
    ),
    "simulates: outputs that are not finite": (PI, "_run", after(lambda y: y * np.nan)),
    "simulates: inputs that change": (PI, "_run", spoiled_input),
    "streams: a stream that differs by a bit": (
        Stream,
        "step",
        after(lambda y: np.nextafter(y, np.inf)),
    ),
    "streams: reset that does nothing": (
        Stream,
        "reset",
        lambda original: lambda self: None if hasattr(self, "_started") else original(self),
    ),
    "simulates_many: simulate_many that mixes rows": (
        PI,
        "simulate_many",
        after(lambda y: y[::-1]),
    ),
    "saves: saving that rounds": (PI, "to_dict", rounded),
    "takes_recordings: recordings with other outputs": (
        PI,
        "_inputs_from",
        after(lambda inputs: inputs + 1e-9),
    ),
    "refuses_bad_arrays: arrays with NaN": (
        PI,
        "_inputs_from_array",
        lambda original: lambda self, a: original(self, np.nan_to_num(a)),
    ),
    "knows_its_time: outputs that depend on the sample time": (PI, "coefficients", timed),
    "inverts: an inverse that is a little off": (Inverse, "_run", after(lambda u: u * (1 + 1e-8))),
    "inverts: an inverse deaf to states": (
        Inverse,
        "initial_state",
        lambda original: (
            lambda self, first, initial=None, sample_time=None: original(
                self, first, None, sample_time
            )
        ),
    ),
    "inverts: nothing to reach": (
        PI,
        "reachable",
        instead(lambda self: (np.array([2.0]), np.array([1.0]))),
    ),
    "inverts: clipping in silence": (Inverse, "report", instead(lambda self, state: None)),
}
"""Law and fault -> the member of a class that is replaced, and what makes the faulty one."""


def first_broken(block: Block) -> str:
    """Return the name of the law that `check_block` finds broken."""
    with pytest.raises(ContractError, match=f"'{block.kind}'") as caught:
        check_block(block)
    assert caught.value.remedy
    frames = {frame.name.removeprefix("_") for frame in caught.traceback}
    (law,) = frames & {law.__name__.removeprefix("_") for law in LAWS}
    return law


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_blocks_are_caught(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, name, make = BROKEN[fault]
    check_block(PI.example())
    monkeypatch.setattr(owner, name, make(getattr(owner, name)))
    assert first_broken(PI.example()) == fault.partition(":")[0]


@pytest.mark.parametrize(
    ("hidden", "step"), [(False, None), (True, None), (True, 0.1)], ids=["unasked", "any", "one"]
)
def test_a_block_whose_rate_counts_and_that_does_not_say_so_is_caught(
    hidden: bool, step: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not ask for the time that it needs, follows any, or takes every step for one time."""
    original = RateDependentPI.coefficients
    if hidden:
        monkeypatch.setattr(RateDependentPI, "rate_dependent", False)
    monkeypatch.setattr(
        RateDependentPI, "coefficients", lambda self, given: original(self, step or given or 0.1)
    )
    assert first_broken(RateDependentPI.example()) == "knows_its_time"
