"""The API reference: one page for each use of the package, filled from the docstrings by Sphinx."""

from __future__ import annotations

import importlib
import inspect
import sys
from typing import Any, NamedTuple

import mckibben
from making.pages import MADE, plain, table, toctree, write


class Use(NamedTuple):
    """A page: a purpose, and the names for it."""

    title: str
    names: str


USES = {
    "recordings": Use(
        "Recordings and files",
        "mckibben: Recording ReadOptions read write info; mckibben.files: columns_of",
    ),
    "describe": Use(
        "Describe a muscle",
        "mckibben: characterize data_gaps plan plot; mckibben.diagnosis: characterize Characterization "
        "Cycle; mckibben.metrics: Scores score rmse mae nrmse max_error r2 err loop_width loop_area "
        "crosstalk",
    ),
    "fit": Use(
        "Fit a model",
        "mckibben: fit models estimator; mckibben.studying.results: Fit; "
        "mckibben.estimators.core.estimator: Estimator Diagnostics; "
        "mckibben: PIEstimator GPIEstimator MPIEstimator EUPIEstimator",
    ),
    "choose": Use(
        "Select a model",
        "mckibben: compare study check review calibrate; mckibben.comparison.leaderboard: Leaderboard",
    ),
    "control": Use(
        "Invert a model, close the loop",
        "mckibben: invert track learn; mckibben.studying.results: Inverse Tracking; "
        "mckibben.control: track Tracked learn learned Learned control_law Controller BlockController "
        "tune_pid DisturbanceObserver EstimatedLoad Twin preview_time previewed before Before "
        "slow_cycle uncompensated; mckibben.stream: run FixedRate Deadlines Step",
    ),
    "export": Use(
        "Export a model, drive a device",
        "mckibben: export; mckibben.exporting: export_c Serving state_of export_fmu export_ros2; "
        "mckibben.link: Link LinkError Port Device State Statistics Note",
    ),
    "report": Use(
        "Reports",
        "mckibben: write_report reproduce; mckibben.report: StudyFolder write_leaderboard",
    ),
    "rigs": Use(
        "Virtual rigs and environments",
        "mckibben: Rig load_rig; "
        "mckibben.rigs: rig_names describe save_rig record share; "
        "mckibben.environments: Tracking",
    ),
    "muscles": Use(
        "Muscle library",
        "mckibben.muscles: list load show Muscle Sheet Prior prior_of described scaled",
    ),
    "signals": Use(
        "Signals: excitations, cycles, filters",
        "mckibben.signals: triangle decaying_triangle progressive_triangle irregular_triangle sine "
        "decaying_sine progressive_sine chirp multisine random_wave binary_steps "
        "staircase ramps constant pulls build settings_of cut resample decimate_minmax coarsened "
        "made_manageable detrend low_pass zeroed noise_level reversals branches cycles "
        "split_cycles",
    ),
    "models": Use(
        "Run, combine and save models",
        "mckibben: Block load simulate Series Parallel PerChannel Channel Banded PI RateDependentPI GPI "
        "EUPI Play Affine PiecewiseLinear Polynomial check_block",
    ),
    "errors": Use(
        "Errors and warnings",
        "mckibben: MckibbenError DataError ModelError DataWarning ModelWarning",
    ),
}

OPERATIONS = (
    *("read", "info", "characterize", "data_gaps", "plan", "fit", "compare", "study", "check"),
    *("simulate", "invert", "track", "learn", "calibrate", "review", "export", "plot"),
    *("write_report", "reproduce", "models", "estimator", "load", "write"),
)
"""Functions that do a whole job, in the order of use."""

PACKAGES = ("control", "diagnosis", "exporting", "files", "link", "muscles", "report", "rigs")
PACKAGES += ("signals", "stream")
"""Packages whose names are public, beside those of `mckibben` itself."""


def listed(use: Use) -> list[tuple[str, str]]:
    """Return the module and name of everything on a page."""
    pairs = [part.split(":") for part in use.names.split(";")]
    return [(module.strip(), name) for module, names in pairs for name in names.split()]


def missing() -> list[str]:
    """Return public classes and functions that are on no page."""
    shown = {id(found(*pair)) for use in USES.values() for pair in listed(use)}
    lacking = []
    for module in ("mckibben", *(f"mckibben.{name}" for name in PACKAGES)):
        held = importlib.import_module(module)
        for name in getattr(held, "__all__", None) or vars(held):
            value = getattr(held, name)
            own = getattr(value, "__module__", "").startswith("mckibben")
            if callable(value) and own and not name.startswith("_") and id(value) not in shown:
                lacking.append(f"{module}.{name}")
    return lacking


def found(module: str, name: str) -> Any:
    """Return a class or function."""
    return getattr(importlib.import_module(module), name)


def first_line(operation: str) -> str:
    """Return what an operation does."""
    return (inspect.getdoc(found("mckibben", operation)) or "").splitlines()[0]


def write_api() -> None:
    """Write the pages; exits where a public name is on none of them."""
    if lacking := missing():
        sys.exit(f"on no page of docs/making/api.py: {', '.join(lacking)}")
    rows = []
    for page, use in USES.items():
        lines = [use.title, "=" * len(use.title), ""]
        for module, name in listed(use):
            if inspect.isclass(found(module, name)):
                lines += [f".. autoclass:: {module}.{name}", "   :members:", ""]
            else:
                lines += [f".. autofunction:: {module}.{name}", ""]
        write(MADE / "api" / f"{page}.rst", "\n".join(lines))
        names = ", ".join(f"`{name}`" for _, name in listed(use))
        rows.append([f"[{use.title}]({page}.rst)", names])
    version = f"Version {plain(mckibben.__version__)}."
    lines = ["# API reference", "", "```{index} !API, !reference, !functions", "```", ""]
    lines += [f"Classes and functions by purpose. {version} The estimator of each model,"]
    lines += ["with its settings, is described on [the page of the model](../models/index.md).", ""]
    done = [[f"{{py:func}}`mckibben.{name}`", plain(first_line(name))] for name in OPERATIONS]
    lines += ["## Operations", "", *table(["function", "purpose"], done), "## Pages", ""]
    lines += [*table(["purpose", "names"], rows), *toctree(list(USES), "hidden")]
    write(MADE / "api" / "index.md", "\n".join(lines))
