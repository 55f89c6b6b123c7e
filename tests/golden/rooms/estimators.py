"""Every estimator on two data sets: errors, response, parameters that data determine, within 0.5 %."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Block, ModelWarning, Recording, registry
from tests.golden.case import Case, Leaf, Tree, flat
from tests.golden.models import between
from tests.golden.plants import noise, runs
from tests.golden.rounding import rounded
from tests.golden.stored import load

SMALL = {"n_operators": 4, "n_starts": 4, "n_refined": 1}
LOADED = {"input": ("pressure",), "output": ("displacement",), "scheduling": ("force",)}
ONE = {"input": ("pressure",), "output": ("displacement",), "scheduling": ()}
SENT = {"input": "voltage", "output": "pressure"}
STOPS = {"n_stops": 3, "n_lags": 1, "elasticity": 3}
MEMORY = {"memory": "pi", "memory_settings": {"n_operators": 4}, "n_sets": 1, "n_friction": 2}
SWARM = {"particles": 6, "iterations": 4, "search_samples": 400}

SINGLE: Mapping[str, Mapping[str, Any]] = {
    "armax": {},
    "arx": {},
    "balance": STOPS | ONE,
    "bj": {},
    "bouc-wen": {},
    "cpi": {"n_operators": 4},
    "duhem": {},
    "eupi": SMALL,
    "gbw": {},
    "gpi": SMALL,
    "kp": {"n_levels": 5},
    "maxwell-slip": {"n_operators": 4},
    "mms": SMALL,
    "mpi": SMALL,
    "narx-play": {"n_terms": 6, "n_play": 3},
    "oe": {},
    "p1": {},
    "p1z": {},
    "p2": {},
    "p2u": {},
    "p2uz": {},
    "p2z": {},
    "p3": {},
    "pi": {"n_operators": 4},
    "play-ridge": ONE,
    "preisach": {"n_levels": 5},
    "rdpi": SMALL,
}
OF_FORCE: Mapping[str, Mapping[str, Any]] = {
    "balance-force": STOPS,
    "force-bilinear": {},
    "force-chou": {},
    "force-minh": {},
    "force-petrovic": {},
    "force-schindele": {},
    "force-tondu": {},
    "multistate": {},
    "multistate-11": {"n_starts": 8},
    "multistate-18": {},
}
OF_ARM: Mapping[str, Mapping[str, Any]] = {
    "balance": STOPS,
    "coupled-memory": {},
    "coupled-pi": {},
    "play-ridge": {},
    "sdchm": MEMORY,
    "sdchm-published": SWARM,
    "tsfnn": {"n_sets": 2},
}
SHAKEN: dict[str, Any] = {"input": "force", "output": "displacement", "substeps": 1}
SHOWN: Mapping[tuple[str, str], Mapping[str, Mapping[str, Any]]] = {
    ("muscle", "bundled"): SINGLE,
    ("bench", "bench-rougher"): OF_FORCE,
    ("activated", "activated-rougher"): {"activation-memory": {}, "activation-pressure": {}},
    ("commanded", "commanded-slower"): {
        "air": {"n_starts": 4},
        "narx": SENT | {"n_terms": 6},
        "narx-network": SENT | {"n_units": 2, "n_starts": 4},
    },
    ("shaken", "shaken-softer"): {
        "state-network": SHAKEN | {"n_states": 2, "n_units": 1, "n_steps": 100},
    },
    ("lifted", "lifted-stiffer"): {
        "balance": STOPS | LOADED,
        "coupled-memory": LOADED,
        "mpi-narmax": LOADED | {"n_sets": 2, "method": "ls"},
    },
    ("arm", "arm-looser"): OF_ARM,
}
"""Two plants -> the estimators fitted to both, with settings that make it quick."""

CHANCE: Mapping[str, float] = {"narx-network": 0.05, "sdchm-published": 0.05, "state-network": 0.05}
"""Model -> how far its errors and response may move: trained from chance, last bits choose."""

SAMPLES = 30
"""Of the run that is stored of every fitted model, whatever its parameters are."""

DETERMINED = 5e-4
"""How far a parameter may move, relative to its size, where the output moves by a thousandth."""


def fit(model: str, settings: Mapping[str, Any], plant: str, moved: float = 0.0) -> dict[str, Tree]:
    """Return errors of a fit and, by their names in its file, the parameters of the model."""
    recordings = [_moved(run, moved) for run in runs(plant)]
    estimator = registry.load("estimators", model)(**settings).fit(recordings)
    known = estimator.diagnostics_
    return {
        "rmse": known.rmse,
        "rmse_from_rest": known.rmse_from_rest,
        "r2": estimator.score(recordings),
        "n_samples": known.n_samples,
        "n_parameters": known.n_free,
        "response": _response(estimator.model_, recordings[0]),
        "model": {
            key: value
            for key, value in estimator.model_.to_dict().items()
            if key not in ("format", "version")
        },
    }


def _response(model: Block, run: Recording) -> np.ndarray:
    """Return a short free run over a path within the ranges of a recording."""
    ranges = [(float(run[c.name].min()), float(run[c.name].max())) for c in model.inputs]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return model.simulate(between(ranges, n=SAMPLES), sample_time=run.sample_time)


def _moved(run: Recording, share: float) -> Recording:
    """Return a recording whose outputs have a little more noise."""
    outputs = [name for name in run.channels if name.startswith("displacement")] or ["force"]
    if "contraction" in run or "voltage" in run:
        outputs = ["pressure"]
    return run.with_channels(
        **{
            name: run[name] + noise(99, share * float(np.std(run[name])), len(run))
            for name in outputs
        }
    )


def determined(case: str, model: str, settings: Mapping[str, Any], plant: str) -> dict[str, Leaf]:
    """Return a fit without what the data do not determine, which was found when it was stored."""
    found = flat(rounded(fit(model, settings, plant)))
    held = load(case)
    if held is None:
        other = flat(rounded(fit(model, settings, plant, moved=1e-3)))
        names = {name for name in found if _same(found[name], other.get(name))}
    else:
        names = set(held.leaves)
    return {
        name: value
        for name, value in found.items()
        if name in names or not name.startswith("model/")
    }


TIED = {"multistate-11/bench-rougher", "multistate-18/bench", "multistate-18/bench-rougher",
        "balance/lifted"}  # fmt: skip
"""Fits that end in one of several minima, as the last bits choose."""


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return bool(abs(one - other) <= DETERMINED * abs(one))
    return np.array_equal(one, other)


def run(case: str, model: str, settings: Mapping[str, Any], plant: str, folder: Path) -> Tree:
    """Return what is compared of a fit."""
    return determined(case, model, settings, plant)


def cases() -> Iterator[Case]:
    """Yield every estimator on two plants."""
    for plants, models in SHOWN.items():
        for model, settings in models.items():
            for plant in plants:
                name = f"estimators/{model}/{plant}"
                yield Case(
                    name,
                    f"estimators[{model!r}](**{dict(settings)}).fit(plants.runs({plant!r}))",
                    partial(run, name, model, settings, plant),
                    {"n_*": 0.0, "r*": CHANCE.get(model, 0.005), "*": 0.005},
                    one_machine=f"{model}/{plant}" in TIED,
                )
