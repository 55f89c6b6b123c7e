"""The parts of the model that the paper prints: its hysteresis by order, and its gains."""

from __future__ import annotations

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.metrics import err
from mckibben.papers.reproduction import Cell, Table
from mckibben.papers.sdchm import printed
from mckibben.papers.sdchm.published import coupling as printed_coupling
from mckibben.recording import Recording


def orders(run: Recording, sizes: tuple[int, ...], seed: int) -> Table:
    """Return Table 2: the error of the first muscle's GPI by its order."""
    rows: list[tuple[Cell, ...]] = []
    for n in sizes:
        cells: list[Cell] = []
        for rule, start in (("paper", "virgin"), ("envelope", "first_sample")):
            block = (
                registry.load("estimators", "gpi")(
                    input="pressure_1",
                    output="displacement_1",
                    n_operators=n,
                    threshold_rule=rule,
                    initial=start,
                    seed=seed,
                )
                .fit(run)
                .model_
            )
            y = run["displacement_1"]
            cells.append(err(y, block.simulate(run["pressure_1"])))
        rows.append((n, printed.ORDERS[n], *cells))
    return Table(
        "Err of the first muscle's hysteresis by order [%] (its Table 2)",
        ("N", "printed", "here, as published", "here, thresholds over the envelopes"),
        tuple(rows),
        "As published: thresholds by its Eq. (7), of which those beyond half the envelopes' range never "
        "move, and operators started from 0 by its Eq. (1).",
    )


def gains(model: Block) -> Table:
    """Return Table 3: the coupling found beside the printed one."""
    assert isinstance(model, Series)
    coupling = model.parts[1]
    assert isinstance(coupling, Coupling)
    said, here = printed_coupling().matrix, coupling.matrix
    pairs = [(i, j) for i in range(3) for j in range(3) if i != j]
    rows = tuple((f"G{i + 1}{j + 1}", float(said[i, j]), float(here[i, j])) for i, j in pairs)
    return Table(
        "Coupling gains (its Table 3)",
        ("gain", "printed", "here"),
        rows,
        f"G21: what muscle 2 gives muscle 1. Spectral radius of Jacobi's iteration: printed "
        f"{printed_coupling().radius:.3f}, here {coupling.radius:.3f}.",
    )
