"""What was wrong once, with its right value."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.io import loadmat

import mckibben
from mckibben import MckibbenError, Recording, registry
from mckibben.control import track
from tests import recordings
from tests.golden.case import Case, Tree
from tests.golden.commands import answered, call
from tests.golden.plants import STEP, cycles, noise, play, runs
from tests.golden.rooms.commands import MODEL

SCALED = ("balance", "bouc-wen", "cpi", "duhem", "gpi", "kp", "mpi")
QUICK = {"n_operators": 4, "n_starts": 4, "n_refined": 1, "n_levels": 5, "n_stops": 3, "n_lags": 1}
NANO = 1e-6

CACHED = "simulate pi.json test.csv -o out.csv --force"
DAMAGES: Mapping[str, float] = {"emptied": 0.0, "cut off": 0.5}
"""How cached kernels are damaged -> the share of every file that is left."""


def zeroing(folder: Path) -> Tree:
    """Two recordings that never rest and begin on different branches: no zero has to be moved."""
    del folder
    fallen = np.concatenate([np.linspace(5.0, 1.2, 60), 1.0 + cycles(1.2, n=240)])
    rise = 3.0 - 2.0 * np.cos(np.linspace(0.0, np.pi, 100))
    risen = np.concatenate([rise, 5.0 - cycles(2.0, run=1, n=200)])
    apart = []
    for k, (p, start) in enumerate(((fallen, 60), (risen, 0))):
        y = 3.0 * play(p, 1.2) + p + noise(k, 0.01, len(p))
        channels = {"pressure": p[start:].copy(), "displacement": y[start:].copy()}
        apart.append(Recording(channels, STEP))
    board = mckibben.compare(apart, models=("pi", "mpi"), jobs=1)
    text = json.dumps(board.to_dict())
    return {"told to move the zero": "--zero" in text or "zeroed" in text}


def scaled(model: str, folder: Path) -> Tree:
    """The error of a fit, relative to the output's unit, where the output is a million times smaller."""
    del folder
    errors = []
    for scale in (1.0, NANO):
        estimator = registry.load("estimators", model)()
        known = estimator.get_params()
        estimator.set_params(**{key: value for key, value in QUICK.items() if key in known})
        smaller = [
            run.with_channels(displacement=scale * run["displacement"]) for run in _loops_in_steps()
        ]
        errors.append(estimator.fit(smaller).diagnostics_.rmse / scale)
    return {"error over that in mm": errors[1] / errors[0]}


def _loops_in_steps() -> list[Recording]:
    """Two play operators under triangles, with noise, as of a piezo stage."""
    t = np.arange(0, 30, STEP)
    p = 3 - 3 * np.abs(2 * ((t / 10) % 1) - 1)
    y = 4 * play(p, 0.3) + 2 * play(p, 0.8) + noise(0, 0.02, len(p))
    return [Recording({"pressure": p, "displacement": y}, STEP)]


def black_box(folder: Path) -> Tree:
    """The same on half a period of the Bouc-Wen benchmark, and half of its test."""
    del folder
    parts = []
    for u, y in (("uest", "yest"), ("uval", "yval")):
        found = []
        for name in (u, y):
            content = loadmat(recordings.MEASURED / "bouc_wen_benchmark" / f"{name}_multisine.mat")
            (key,) = (key for key in content if not key.startswith("_"))
            found.append(content[key][0, :4096].astype(float))
        channels = {"force": found[0], "displacement": 1000.0 * found[1]}
        parts.append(Recording(channels, 1 / 750))
    return _chosen(parts[0], parts[1], n_units=5)


def _chosen(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    n_units: int = 2,
) -> Tree:
    """Return which of a network and a linear model is better where they are validated, and chosen."""
    board = mckibben.compare(
        train,
        test,
        input="force",
        output="displacement",
        models=("state-network", "p2uz"),
        settings={"state-network": {"n_units": n_units, "n_steps": 60, "substeps": 1}},
        jobs=1,
    ).to_dict()
    errors = {row["model"]: row["validation_rmse"] for row in board["rows"]}
    return {
        "network is better": errors["state-network"] < errors["p2uz"],
        "chosen": board["chosen"],
    }


def seal(folder: Path) -> Tree:
    """Friction of a seal has two levels by direction, and no inverse by displacement."""
    (folder / "seal.csv").write_bytes(
        (recordings.MEASURED / "foreign_friction" / "seal_circle_2bar.csv").read_bytes()
    )
    columns = {"time": (1, "ms"), "pressure": (6, "bar"), "displacement": (5, "mm")}
    words = ["study", "seal.csv", "--input", "displacement", "--output", "force"]
    for name, (column, unit) in (columns | {"force": (7, "N")}).items():
        words += ["--column", f"{name}=column_{column}", "--unit", f"{name}={unit}"]
    words += ["--models", "bouc-wen,maxwell-slip", "--jobs", "1", "-o", "out"]
    return {"inverse": answered(*words, folder=folder)["inverse"]}


def contraction(folder: Path) -> Tree:
    """A compensator that wants a contraction is given one, or refused, where a reference is in mm."""
    del folder
    rig, length = mckibben.load_rig("mckibben-530"), 530.0
    t = np.arange(0, 40, 0.05)
    p = 1.8 - 1.2 * np.cos(0.8 * t) - 0.4 * np.cos(0.31 * t)
    given = Recording({"pressure": p, "force": np.full(t.size, 100.0)}, 0.05)
    measured = rig.run(given)
    known = measured.with_channels(
        {"contraction": ""}, contraction=measured["displacement"] / length
    )
    model = registry.load("estimators", "activation-memory")().fit(known).model_
    wanted = Recording(
        {"displacement": measured["displacement"][200:500], "force": np.full(300, 100.0)}, 0.05
    )
    try:
        off = track(model, rig, wanted, approach=5.0).rmse["displacement"]
    except MckibbenError:
        off = 0.0
    return {"off in mm, 0 where refused": off}


def constants(folder: Path) -> Tree:
    """Numbers that are fixed are no parameters."""
    del folder
    counted = []
    for free in (True, False):
        estimator = registry.load("estimators", "mpi-narmax")(
            input=("pressure",),
            output=("displacement",),
            scheduling=("force",),
            constants=free,
            method="ls",
        )
        counted.append(estimator.fit(runs("lifted")).diagnostics_.n_free)
    return {"constants counted": counted[0] - counted[1]}


def module(folder: Path) -> Tree:
    """The package runs as a module."""
    return {"code": _apart(folder, "-m", "mckibben", "--version").returncode}


def damaged(folder: Path) -> Tree:
    """Compiled kernels that are damaged stop no command: they are compiled anew."""
    cache = folder / "cache"
    cache.mkdir(mode=0o700)
    mckibben.PI((0.0, 0.5), (2.0, 1.0)).save(folder / "pi.json")
    mckibben.write(runs("muscle")[0], folder / "test.csv")
    command = ("-c", "from mckibben.cli.main import run; run()", *CACHED.split())
    codes = {"first": _apart(folder, *command, NUMBA_CACHE_DIR=str(cache)).returncode}
    kernels = {
        path: path.read_bytes() for path in cache.rglob("*") if path.suffix in (".nbi", ".nbc")
    }
    for how, share in DAMAGES.items():
        for path, content in kernels.items():
            path.write_bytes(content[: int(share * len(content))])
        codes[how] = _apart(folder, *command, NUMBA_CACHE_DIR=str(cache)).returncode
    return {"kernels": bool(kernels), "codes": codes}


def _apart(folder: Path, *words: str, **variables: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, *words]
    return subprocess.run(
        command, cwd=folder, env=os.environ | variables, capture_output=True, check=False
    )


def studied_again(folder: Path) -> Tree:
    """What a study has written stays until the next one has something better."""
    for name, recording in zip(("train", "test"), runs("muscle"), strict=True):
        mckibben.write(recording, folder / f"{name}.csv")
    words = ("study", "train.csv", "--test", "test.csv", "--models", "pi", "--jobs", 1, "-o", "out")
    first = call(*words, folder=folder)
    before = {path.name: path.read_bytes() for path in (folder / "out").glob("*.*")}

    def stopped(*given: Any, **named: Any) -> None:
        raise KeyboardInterrupt

    with patch.object(mckibben.PIEstimator, "fit", stopped):
        call(*words, "--force", "--set", "n_operators=4", folder=folder)
    after = {path.name: path.read_bytes() for path in (folder / "out").glob("*.*")}
    return {
        "first": first.code,
        "lost": sorted(name for name in before if name not in after),
        "board is as before": before["leaderboard.json"] == after.get("leaderboard.json"),
    }


def arrays(folder: Path) -> Tree:
    """Arrays where recordings are wanted are refused with the name of what makes one of them."""
    del folder
    given: Any = np.column_stack([cycles(5.0), cycles(5.0)])
    attempts: dict[str, Callable[[], Any]] = {
        "compare": lambda: mckibben.compare(given),
        "fit": lambda: mckibben.GPIEstimator().fit(given),
        "characterize": lambda: mckibben.characterize(given),
    }
    found: dict[str, Tree] = {}
    for name, attempt in attempts.items():
        try:
            attempt()
        except Exception as error:  # whatever it is today
            told = isinstance(error, MckibbenError) and "mckibben.Recording" in str(error)
            found[name] = told
        else:
            found[name] = False
    return found


def perfect(folder: Path) -> Tree:
    """The log of a loop without any error is reviewed like another."""
    (folder / "model.json").write_text(json.dumps(MODEL))
    mckibben.write(runs("muscle")[1], folder / "wanted.csv")
    codes = [
        call(*words.split(), folder=folder).code
        for words in (
            "invert model.json -o inverse.json",
            "track inverse.json --plant model.json --reference wanted.csv -o log.csv",
            "study log.csv --compensator inverse.json --models pi --jobs 1 -o review",
        )
    ]
    return {"codes": codes}


CASES: Mapping[str, tuple[str, Callable[[Path], Tree], Mapping[str, Any]]] = {
    "zeroing": ("mckibben.compare(two runs that never rest)", zeroing, {}),
    **{
        f"scale/{model}": (
            f"estimators[{model!r}].fit, output in mm and times 1e-6",
            partial(scaled, model),
            {"tolerances": {"*": 0.005}},
        )
        for model in SCALED
    },
    "state-network-benchmark": (
        "mckibben.compare, a network beside p2uz",
        black_box,
        {"needs": ("bouc_wen_benchmark",), "slow": True},
    ),
    "seal": ("mckibben study seal.csv", seal, {"needs": ("foreign_friction",)}),
    "contraction": ("track(compensator of contraction, rig, mm)", contraction, {}),
    "constants": ("n_free of mpi-narmax", constants, {}),
    "module": ("python -m mckibben --version", module, {}),
    "damaged-cache": (f"mckibben {CACHED}", damaged, {}),
    "studied-again": ("mckibben study, stopped the second time", studied_again, {}),
    "arrays": ("mckibben.compare(array)", arrays, {}),
    "perfect-log": ("mckibben study log.csv --compensator inverse.json", perfect, {}),
}


def cases() -> Iterator[Case]:
    """Yield what is wrong."""
    for name, (said, run, options) in CASES.items():
        yield Case(f"wrong/{name}", said, run, **options)
