"""What a step costs: numbers in memory, and arithmetic, counted from the structure of the blocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

from mckibben.blocks.base import Block
from mckibben.blocks.eupi import EUPIInverse
from mckibben.blocks.force_balance import ForceBalance, ForceBalanceInverse
from mckibben.blocks.fuzzy_network import FuzzyNetwork, FuzzyNetworkInverse
from mckibben.blocks.preisach import Preisach, PreisachInverse
from mckibben.blocks.rate_dependent_pi import RateDependentPIInverse
from mckibben.blocks.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.solved import SolvedInverse
from mckibben.export.c.parts import table
from mckibben.export.c.wiring import Wiring

USUAL_TRIALS, MOST_TRIALS = 12, 600
"""Of an inverse solved by bracketing: on smooth references, and at worst."""

USUAL_NEWTON, MOST_NEWTON = 3, 60
"""Steps of Newton's method, on smooth references and at worst."""


@dataclass(frozen=True)
class Cost:
    """Arithmetic operations of a step, roughly: usual and at worst."""

    usual: int
    worst: int

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.usual + other.usual, self.worst + other.worst)


def cost_of(wiring: Wiring) -> Cost:
    """Return what a step of a model costs."""
    total = Cost(0, 0)
    for call in wiring.calls:
        total += cost(call.part.block, wiring.sample_time)
    return total


@singledispatch
def cost(block: Block, sample_time: float | None) -> Cost:
    """Return what a step of a block costs: about two operations a coefficient, four a state."""
    operations = 2 * table(block, sample_time).size + 4 * block.n_states
    return Cost(operations, operations)


@cost.register(SolvedInverse)
@cost.register(EUPIInverse)
@cost.register(RateDependentPIInverse)
def _solved(
    block: SolvedInverse | EUPIInverse | RateDependentPIInverse, sample_time: float | None
) -> Cost:
    once = cost(block.forward, sample_time).usual
    return Cost(USUAL_TRIALS * once, MOST_TRIALS * once)


@cost.register(Preisach)
@cost.register(PreisachInverse)
def _preisach(block: Preisach | PreisachInverse, sample_time: float | None) -> Cost:
    del sample_time
    levels = len(block.forward.levels if isinstance(block, PreisachInverse) else block.levels)
    once = 20 + 4 * levels.bit_length()
    walk = levels if isinstance(block, PreisachInverse) else 1
    return Cost(once * max(1, walk // 2), once * walk + 64)


@cost.register
def _network(block: FuzzyNetwork, sample_time: float | None) -> Cost:
    del sample_time
    n, rules = len(block.centres), 1
    for row in block.centres:
        rules *= len(row)
    each = n + len(block.given) * (2 * n + 2)
    operations = rules * each + 10 * sum(map(len, block.centres))
    return Cost(operations, operations)


@cost.register
def _network_inverse(block: FuzzyNetworkInverse, sample_time: float | None) -> Cost:
    m = len(block.outputs)
    once = cost(block.forward, sample_time).usual * (1 + m) + m**3
    return Cost(USUAL_NEWTON * once, MOST_NEWTON * once)


@cost.register
def _recurrent(block: RecurrentFuzzyNetwork, sample_time: float | None) -> Cost:
    del sample_time
    n, sets = block.n_regressors, block.n_sets
    operations = sets**n * (3 * n + 3) + 10 * n * sets
    return Cost(operations, operations)


@cost.register
def _balance(block: ForceBalance, sample_time: float | None) -> Cost:
    operations = 4 * table(block, sample_time).size
    return Cost(operations, operations)


@cost.register
def _balance_inverse(block: ForceBalanceInverse, sample_time: float | None) -> Cost:
    once = cost(block.forward, sample_time).usual + len(block.outputs) ** 3
    return Cost(USUAL_NEWTON * once, MOST_NEWTON * once)
