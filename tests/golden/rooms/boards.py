"""Leaderboards: which model is chosen, in which order, and by what errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import mckibben
from mckibben import example
from tests import recordings
from tests.golden.case import Case, Tree
from tests.golden.commands import answered
from tests.golden.plants import runs
from tests.golden.rounding import rounded

NUMBERS = ("n_parameters", "validation_rmse", "skill")
KINDS = ("model", "status", "validation_failed", "rate_dependent", "invertible")
SCORES = ("rmse", "nrmse", "rank")

TOLERANCES = {
    "n_*": 0.0,
    "*/n_*": 0.0,
    "*/rank": 0.0,
    "*/order/*": 0.0,
    "*/skill": 0.001,
    "*/at_most": 0.01,  # of a bootstrap, which is seeded: one of its samples more or less
    "*": 0.005,
}

SMALL = {"n_operators": 4, "n_starts": 4, "n_refined": 1}
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "balance": {"n_stops": 3, "n_lags": 1, "elasticity": 3, "steps": 10},
    "gpi": SMALL,
    "mpi-narmax": {"n_sets": 2, "method": "ls"},
    "tsfnn": {"n_sets": 2},
}

OWN: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "example": ("bundled example", {"models": ("pi", "gpi", "mpi", "duhem", "p2uz", "arx")}),
    "example-held-out": ("bundled example", {"models": ("pi", "mpi", "kp", "p1")}),
    "muscle": ("muscle", {"models": ("pi", "gpi", "mpi", "bouc-wen", "narx-play", "oe")}),
    "muscle-labels": ("muscle", {"models": {"first": "pi", "second": "mpi", "third": "p2"}}),
    "muscle-thinned": ("muscle", {"models": ("pi", "mpi", "kp"), "most_samples": 150}),
    "arm": ("arm-of-levels", {"models": ("coupled-memory", "coupled-pi", "tsfnn")}),
    "arm-without-levels": ("arm", {"models": ("coupled-memory", "tsfnn", "balance")}),
    "load": (
        "lifted",
        {"models": ("balance", "coupled-memory", "mpi-narmax", "mpi"), "load": "force"},
    ),
    "isometric": (
        "isometric",
        {"models": ("force-petrovic", "force-minh", "force-chou", "force-tondu")},
    ),
    "all-offered": ("muscle", {"models": ("pi", "force-chou", "coupled-memory", "air", "arx")}),
}
"""Case -> recordings, and how they are compared."""

MEASURED: Mapping[str, str] = {
    "cavatappi_loads": "pi,mpi,kp,coupled-memory",
    "festo_dmsp10_levels": "pi,mpi,kp",
    "festo_dmsp10_static": "pi,mpi,kp,gpi",
    "festo_isometric_20mm": "force-petrovic,force-schindele",
    "sma_wing": "pi,mpi,kp,preisach",
    "soft_arm_three_muscles": "coupled-memory",
    "bouc_wen_benchmark": "pi,p2uz",
}
"""Set of shared recordings -> models."""

SLOW = {"bouc_wen_benchmark"}

TIED = {"muscle-thinned", "festo_dmsp10_levels", "festo_isometric_20mm"}
"""Boards on which two models are as good, and the last bits choose."""


def shown(board: Mapping[str, Any]) -> dict[str, Tree]:
    """Return what is compared of a leaderboard as its file holds it."""
    rows = board["rows"]
    return {
        **{key: board[key] for key in ("input", "output", "unit", "seed", "n_train", "n_test")},
        "chosen_by": board["chosen_by"],
        "chosen": board["chosen"],
        "recommended": board["not_recommended"] is None,
        "lowest_on_test": board["lowest_on_test"],
        "left_out": sorted(board["left_out"]),
        "shared": len(board["shared"]),
        "order": [row["model"] for row in rows],
        "rows": [rounded(_row(row)) for row in rows],
    }


def _row(row: Mapping[str, Any]) -> dict[str, Any]:
    if row["status"] == "failed":
        return {key: row[key] for key in ("model", "status")}
    found: dict[str, Any] = {key: row[key] for key in (*KINDS[:2], *NUMBERS)}
    found["failed"] = row["validation_failed"] is not None
    found |= {key: row[key] for key in KINDS[3:]}
    for side in ("train", "test"):
        scores = row[side] or {}
        found[side] = {key: scores[key] for key in SCORES if key in scores}
    if row["test"]:
        found["test"] |= {"at_most": row["test"]["rmse_interval"][1]}
    if row["memory"]:
        found["gap_ratio"] = row["memory"]["gap_ratio"]
    if len(row["outputs"]) > 1:
        found["outputs"] = {
            name: {key: one[key] for key in ("rmse", "validation_rmse")}
            for name, one in row["outputs"].items()
        }
    return found


def own(plant: str, options: Mapping[str, Any], folder: Path) -> Tree:
    """Compare models on a plant's recordings, or on the bundled ones."""
    del folder
    test: Sequence[mckibben.Recording] = ()
    if plant == "bundled example":
        train = mckibben.read(example.TRAIN)
        test = mckibben.read(example.TEST) if "gpi" in options["models"] else ()
    else:
        train = list(runs(plant))
    settings = {name: SETTINGS[name] for name in options["models"] if name in SETTINGS}
    board = mckibben.compare(train, test, settings=settings, jobs=1, **options)
    return shown(board.to_dict())


def measured(name: str, models: str, folder: Path) -> Tree:
    """Compare models on a set of measured recordings, by its fixed splits."""
    words = ("measured", recordings.MEASURED, "--only", name, "--models", models, "--jobs", 1)
    boards = answered(*words, "-o", folder / "out")
    return [shown(board) | {"range": board["range"]} for board in boards.values()]


def cases() -> Iterator[Case]:
    """Yield leaderboards of small recordings, and of measured ones."""
    for name, (plant, options) in OWN.items():
        yield Case(
            f"boards/{name}",
            f"mckibben.compare({plant}, **{dict(options)})",
            partial(own, plant, options),
            TOLERANCES,
            one_machine=name in TIED,
        )
    for name, models in MEASURED.items():
        yield Case(
            f"boards/measured/{name}",
            f"mckibben measured FOLDER --only {name} --models {models} --json",
            partial(measured, name, models),
            TOLERANCES,
            needs=(name,),
            slow=name in SLOW,
            one_machine=name in TIED,
        )
