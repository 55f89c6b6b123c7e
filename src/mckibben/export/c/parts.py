"""What a primitive of C needs to know of a block: its numbers, its sizes, and how it starts.

Most blocks hand C the coefficients that their own kernel reads. The few that are more than one
kernel, or whose start needs more than the kernel knows, are spelt out here.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block, Primitive
from mckibben.blocks.differential.duhem import Duhem, DuhemInverse
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.envelopes import Envelope
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.gpi import GPI, GPIInverse
from mckibben.blocks.preisach import Preisach, PreisachInverse
from mckibben.errors import ModelError

Array = NDArray[np.float64]

PRIMITIVES = Path(__file__).parent / "primitives"

RULES = {
    "first_sample": "MCK_FIRST_SAMPLE",
    "virgin": "MCK_VIRGIN",
    "fitted": "MCK_FIRST_SAMPLE",
}
"""Starting memories, by what C calls them; no outputs are known there to fit one to."""

ENVELOPES = {"tanh": 0, "exponential": 1, "piecewise-linear": 2}
"""Kinds of envelopes, by their number in gpi.c."""

LAWS = {"polynomial-force": 0, "chou-hannaford": 1, "tondu-lopez": 2}
"""Static force laws, by their number in force_feedforward.c."""


@dataclass(frozen=True)
class Part:
    """A block that is one primitive of C.

    Parameters
    ----------
    block : Block
        What it is.
    function : str
        Start of its functions' names, behind ``mck_``.
    source : Path
        Where its C is; the header is beside it.
    coefficients : array
        Numbers, in the order that the header says.
    rule : str
        Macro of its starting memory.
    state : array or None
        The starting memory itself, where the model gives it.
    """

    block: Block
    function: str
    source: Path
    coefficients: Array
    rule: str
    state: Array | None


def starts_at_rest(block: Block) -> bool:
    """Tell whether a part's first output is the same at any sample time."""
    return not block.rate_dependent or _starting(block) == "first_sample"


def check_single(block: Block) -> None:
    """Refuse places that single precision cannot tell apart.

    Raises
    ------
    ModelError
        If two knots, levels or thresholds that follow one another become one.
    """
    owners = [block, getattr(block, "forward", None)]
    owners += [getattr(owner, side, None) for owner in owners[:2] for side in ("rising", "falling")]
    for owner in owners:
        for name in ("knots", "values", "levels", "thresholds", "breakaways"):
            places = getattr(owner, name, ())
            flat = places if all(isinstance(place, float) for place in places) else ()
            if np.any(np.diff(np.array(flat, dtype=np.float32)) <= 0) and np.all(np.diff(flat) > 0):
                raise ModelError(
                    f"{name} of {block.kind!r} are too close for single precision. "
                    "Remedy: export in double precision, or identify with fewer of them."
                )


def part_of(block: Block, sample_time: float | None) -> Part:
    """Return a block as a part.

    Raises
    ------
    ModelError
        If no C has been written for it.
    """
    function = block.kind.replace("-", "_")
    file = f"{function.removesuffix('_inverse')}.c"
    folders = (PRIMITIVES, Path(inspect.getfile(type(block))).parent)
    sources = [folder / file for folder in folders if (folder / file).is_file()]
    if not sources:
        raise ModelError(
            f"{block.kind!r} has no C. Remedy: write {file} and its header beside the block, as "
            "those of the package are."
        )
    start = _starting(block)
    explicit = None if isinstance(start, str) else block.initial_state(_origin(block))
    rule = RULES[start] if isinstance(start, str) else RULES["first_sample"]
    return Part(block, function, sources[0], table(block, sample_time), rule, explicit)


def _starting(block: Block) -> object:
    """Return the rule, or the memory itself, that a block starts from."""
    for owner in (block, *(getattr(block, name, None) for name in ("forward", "friction"))):
        start = getattr(owner, "initial", None)
        if start is not None:
            return start
    return "first_sample"


def _origin(block: Block) -> Array:
    return np.zeros(len(block.inputs))


@singledispatch
def table(block: Block, sample_time: float | None) -> Array:
    """Return the numbers of a block that its C reads."""
    if not isinstance(block, Primitive):
        raise ModelError(
            f"{block.kind!r} is neither one kernel nor a composition, so it cannot be exported. "
            "Remedy: compose it of blocks."
        )
    return block.coefficients(sample_time)


def _envelope(envelope: Envelope) -> tuple[list[float], list[float]]:
    numbers = envelope.coefficients().tolist()
    return [ENVELOPES[envelope.kind], len(numbers)], numbers


@table.register
def _gpi(block: GPI, sample_time: float | None) -> Array:
    del sample_time
    (rising, up), (falling, down) = _envelope(block.rising), _envelope(block.falling)
    return np.array([*rising, *falling, *block.thresholds, *block.weights, *up, *down])


@table.register
def _gpi_inverse(block: GPIInverse, sample_time: float | None) -> Array:
    return np.array([*block.forward.limits, *table(block.forward, sample_time)])


@table.register
def _duhem(block: Duhem, sample_time: float | None) -> Array:
    own = block.coefficients(sample_time)
    size = (own.size - 3) // 2
    return np.array([*own, *block.target, *[0.0] * (size - len(block.target))])


@table.register
def _duhem_inverse(block: DuhemInverse, sample_time: float | None) -> Array:
    return np.array([*table(block.forward, sample_time), *block.forward.limits])


@table.register
def _preisach(block: Preisach, sample_time: float | None) -> Array:
    return np.array([*block.coefficients(sample_time), block.offset])


@table.register
def _preisach_inverse(block: PreisachInverse, sample_time: float | None) -> Array:
    return table(block.forward, sample_time)


@table.register
def _transfer_function(block: TransferFunction, sample_time: float | None) -> Array:
    at_rest = block.initial_state(np.array([block.input_offset + 1.0]), "first_sample")
    return np.array([*block.coefficients(sample_time), *at_rest])


@table.register
def _force_feedforward(block: ForceFeedforward, sample_time: float | None) -> Array:
    if block.law.kind not in LAWS:
        raise ModelError(
            f"{block.law.kind!r} has no C for feedforward. Remedy: use one of {', '.join(LAWS)}."
        )
    law = block.law.coefficients(sample_time)
    own = np.array([LAWS[block.law.kind], law.size, *law])
    if block.friction is None:
        return own
    return np.concatenate([own, block.friction.coefficients(sample_time)])
