"""Results of operations: models, inverses, loops and code, with numbers for JSON."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from mckibben.blocks.equations import quantities
from mckibben.simulation import Simulates
from mckibben.system.atomic import plain
from mckibben.system.showing import Result

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.control import Before, Learned, Tracked
    from mckibben.control.connecting import Kind, Plant
    from mckibben.estimators.core.estimator import Estimator
    from mckibben.recording import Recording


class Price(NamedTuple):
    """RMSE of the force from rest [N]: with the limits of an export format, and without them."""

    force_rmse: float
    force_rmse_unlimited: float


@dataclass(frozen=True, repr=False)
class Fit(Simulates, Result):
    """A fitted model.

    Parameters
    ----------
    name : str
        Short name of the model.
    model : Block
        With the model whose residual was fitted, where there was one.
    estimator : Estimator
        Fitted; ``diagnostics_`` has errors and uncertainties.
    notes : tuple of str
    file : Path or None
        Where the model is saved.
    price : Price or None
        Of what the format does not carry that the model is for, if it is for one.
    """

    name: str
    model: Block = field(repr=False)
    estimator: Estimator = field(repr=False)
    notes: tuple[str, ...] = field(default=(), repr=False)
    file: Path | None = None
    price: Price | None = None

    face: ClassVar[str] = "fit"

    @property
    def drawn(self) -> Block:
        """What a plot of it draws."""
        return self.model

    def to_frame(self) -> Any:
        """Return the parameters as a data frame: name, value, standard error and unit."""
        import pandas as pd

        numbers = self.to_dict()
        columns = {
            "parameter": numbers["parameter_names"],
            "value": numbers["parameters"],
            "standard_error": numbers["standard_errors"],
            "unit": numbers["parameter_units"],
        }
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return errors and parameters, for JSON."""
        diagnostics, model = self.estimator.diagnostics_, self.estimator.model_
        numbers = quantities(model)
        names = [channel.name for channel in model.outputs]
        copied = ("rmse", "rmse_from_rest", "n_samples", "n_evaluations", "seconds")
        return {
            "model": self.name,
            "file": plain(self.file),
            "n_parameters": diagnostics.n_free,
            **{name: getattr(diagnostics, name) for name in copied},
            "rmse_by_output": dict(zip(names, diagnostics.rmse_by_output, strict=True)),
            "condition": diagnostics.condition,
            "parameters": model.pack().tolist(),
            "parameter_names": [number.name for number in numbers],
            "parameter_units": [number.unit for number in numbers],
            "standard_errors": list(diagnostics.standard_errors),
            "at_bounds": list(diagnostics.at_bounds),
            "undetermined": [numbers[place].name for place in self.estimator.undetermined()],
            "notes": list(self.notes),
            **({} if self.price is None else self.price._asdict()),
        }


@dataclass(frozen=True, repr=False)
class Tracking(Result):
    """Tracking of a reference by a controller, and without compensation.

    Parameters
    ----------
    tracked : Tracked
    uncompensated : Before
    plant : Plant
    plant_kind : {"rig", "same model", "another model"}
        The model that the compensator inverts tells nothing about the muscle.
    flatters_feedback : bool
        Whether feedback performs better on the plant than on a muscle, as the plant has no lag.
    law : str
        Name of the controller.
    seed : int
    controller : Block or Controller
    reference : Recording
        As it was followed, in channels of the plant.
    notes : tuple of str
    file, controller_file : Path or None
        Recording and controller, where they were written.
    learned : Learned or None
        From repetitions of the reference, if there were any; the controller has the corrections of
        the best one.
    """

    tracked: Tracked = field(repr=False)
    uncompensated: Before = field(repr=False)
    plant: Plant = field(repr=False)
    plant_kind: Kind
    flatters_feedback: bool
    law: str
    seed: int
    controller: Any = field(repr=False)
    reference: Recording = field(repr=False)
    notes: tuple[str, ...] = field(default=(), repr=False)
    file: Path | None = None
    controller_file: Path | None = None
    learned: Learned | None = field(default=None, repr=False)

    face: ClassVar[str] = "tracking"

    @property
    def drawn(self) -> Tracked:
        """What a plot of it draws."""
        return self.tracked

    @property
    def loops(self) -> dict[str, Tracked]:
        """The loop of the controller, and that without compensation, if there is one."""
        loops = {self.law: self.tracked, "no compensation": self.uncompensated.tracked}
        return {law: loop for law, loop in loops.items() if loop is not None}

    @property
    def recording(self) -> Recording:
        """The run, as `learn` and `review` take it."""
        return self.tracked.recording

    def to_frame(self) -> Any:
        """Return the errors as a data frame: RMSE and largest, by controller and output."""
        import pandas as pd

        rows = [
            {"controller": law, "output": name, "rmse": rmse, "largest": loop.largest[name]}
            for law, loop in self.loops.items()
            for name, rmse in loop.rmse.items()
        ]
        return pd.DataFrame(rows)

    def to_dict(self) -> dict[str, Any]:
        """Return the errors, for JSON."""
        diagnostics, uncompensated = self.tracked, self.uncompensated.tracked
        return {
            "controller": self.law,
            "plant": {"name": self.plant.name, "kind": self.plant_kind},
            "flatters_feedback": self.flatters_feedback,
            **_errors(diagnostics),
            "learned": plain(self.learned),
            "out_of_reach": {name: far._asdict() for name, far in diagnostics.beyond.items()},
            "uncompensated": None if uncompensated is None else _errors(uncompensated),
            "step_time": dict(zip(("median", "p99.9"), diagnostics.step_time, strict=True)),
            "file": plain(self.file),
            "controller_file": plain(self.controller_file),
            "notes": list(self.notes),
        }


def _errors(loop: Tracked) -> dict[str, Any]:
    return {"rmse": dict(loop.rmse), "largest": dict(loop.largest), "clipped": loop.clipped}


@dataclass(frozen=True, repr=False)
class Inverse(Simulates, Result):
    """A compensator, or a force estimator.

    Parameters
    ----------
    model : Block
        The compensator.
    kind : {"inverse", "adaptive", "predictive", "learned", "feedforward", "force", "itself"}
        The inverse of a memory, one that learns, looks ahead, or is a trained network; a force in
        closed form, by the pressure or estimated; a model that gives pressures already.
    reachable : mapping of str to (float, float)
        Output of the model -> what is reachable whatever happened before; empty where that depends on
        more than the model.
    rmse : mapping of str to float
        Of a learned inverse, by its outputs on the recordings.
    file : Path or None
        Where it is saved.
    """

    face: ClassVar[str] = "inverse"

    model: Block = field(repr=False)
    kind: str
    reachable: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rmse: Mapping[str, float] = field(default_factory=dict)
    file: Path | None = None

    @property
    def block(self) -> Block:
        """Deprecated name of ``model``."""
        warnings.warn("block is now model", DeprecationWarning, stacklevel=2)
        return self.model

    @property
    def drawn(self) -> Block:
        """What a plot of it draws."""
        return self.model

    def to_dict(self) -> dict[str, Any]:
        """Return the kind of inverse and its reachable range, for JSON."""
        return {
            "file": plain(self.file),
            "kind": self.kind,
            "inputs": [channel.name for channel in self.model.inputs],
            "outputs": [channel.name for channel in self.model.outputs],
            "reachable": plain(self.reachable),
            "samples_ahead": self.model.samples_ahead,
            "rmse": dict(self.rmse),
        }


@dataclass(frozen=True, repr=False)
class Exported(Result):
    """Exported code.

    Parameters
    ----------
    path : Path
        Folder, or FMU.
    name : str
        Of functions and files.
    files : tuple of str
        In it.
    self_test, emulation : str or None
        What the self-test and the emulated run printed.
    """

    face: ClassVar[str] = "exported"

    path: Path
    name: str
    files: tuple[str, ...]
    self_test: str | None = None
    emulation: str | None = None
