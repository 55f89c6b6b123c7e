"""Exported C of every model and inverse, in double and in single precision, each compiled once."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from mckibben import Block, ModelError
from mckibben.exporting import export_c
from tests.export.building import Precision, build
from tests.golden.case import Case, Tree
from tests.golden.models import all_models, inputs_of
from tests.golden.rooms.saved import of_file
from tests.golden.running import SAMPLE_TIME, Array, inverse_of, scheduling_of, simulated

EVERY = 4
"""So many samples are stored; C is the same step at each."""

TOLERANCES: dict[Precision, float] = {"double": 1e-12, "float32": 1e-6}

WITHOUT_C: dict[Precision, tuple[str, ...]] = {
    "double": ("published mpi-narmax-mpi",),
    "float32": ("published mpi-narmax-mpi",),
}
"""Models that are refused."""

ABSENT = ("prompt",)
"""Models that give no number where their input is none, which C takes for a fault."""


def models_with_inputs(precision: Precision) -> dict[str, tuple[Block, Array]]:
    """Return models and inverses with what they are run over: inverses over what models gave.

    Models that are no longer fitted, but that files hold, are among them.
    """
    found = {name: saved[:2] for name, saved in of_file("0.1.0-fitted").items()}
    for name, model in all_models().items():
        if name in (*WITHOUT_C[precision], *ABSENT):
            continue
        inputs = inputs_of(name, model)
        found[name] = (model, inputs)
        inverse = inverse_of(model)
        if inverse is not None:
            given = np.column_stack([simulated(model, inputs), scheduling_of(model, inputs)])
            found[f"{name}, inverse"] = (inverse, given)
    return found


def outputs_of(precision: Precision, folder: Path) -> Tree:
    """Return outputs of all by name."""
    models = models_with_inputs(precision)
    kind = np.float64 if precision == "double" else np.float32
    compiled = build({name: model for name, (model, _) in models.items()}, precision, folder / "c")
    return {
        name: compiled[name](inputs)[::EVERY].astype(kind) for name, (_, inputs) in models.items()
    }


def refusals(folder: Path) -> Tree:
    """Return with which error models without C are refused."""
    found: dict[str, Tree] = {}
    for precision, names in WITHOUT_C.items():
        for name in names:
            single, model = precision == "float32", all_models()[name]
            try:
                export_c(model, folder / "c", name="m", sample_time=SAMPLE_TIME, single=single)
            except ModelError as error:
                found[f"{name}, {precision}"] = type(error).__name__
    return found


def cases() -> Iterator[Case]:
    """Yield a case for each precision, and one of what is refused."""
    for precision, tolerance in TOLERANCES.items():
        yield Case(
            f"c/{precision}",
            f"export_c(model, ..., single={precision != 'double'}), compiled and run",
            partial(outputs_of, precision),
            {"*": tolerance},
            tools=("cc",),
        )
    yield Case("c/refused", "export_c(model, ...)", refusals)
