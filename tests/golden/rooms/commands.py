"""The JSON of commands: keys and kinds equal, numbers within 0.5 %; sentences, times and paths apart."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePath
from typing import Any

import numpy as np

import mckibben
from mckibben import example
from tests.golden.case import Case, Tree
from tests.golden.commands import answered, call
from tests.golden.models import example as block_example
from tests.golden.plants import runs
from tests.golden.rounding import rounded
from tests.golden.written import written

MODEL = {
    "format": "mckibben-model",
    "version": 1,
    "kind": "gpi",
    "thresholds": [0.0, 0.2, 0.4, 0.6, 0.8],
    "weights": [9.3, 6.9, 0.5, 2.4, 2.3],
    "rising": {"kind": "tanh", "slope": 0.65, "shift": -1.45, "offset": 1.06},
    "falling": {"kind": "tanh", "slope": 0.72, "shift": -1.2, "offset": 1.07},
    "input_range": [0.0, 5.0],
    "initial": "first_sample",
    "input": {"name": "pressure", "unit": "bar"},
    "output": {"name": "displacement", "unit": "mm"},
}
"""About as identified on ``train.csv``; written here, so that commands need no other fit."""

INVERT = "invert model.json -o inverse.json"
LOOP = "track inverse.json --plant other.json --reference test.csv"

COMMANDS: Mapping[str, Sequence[str]] = {
    "info": ("info train.csv",),
    "info-several": ("info train.csv test.csv",),
    "info-models": ("info --models",),
    "characterize": ("characterize train.csv",),
    "characterize-example": ("characterize decaying-triangle.csv",),
    "fit": ("fit pi train.csv --set n_operators=4 -o pi.json",),
    "fit-mpi": ("fit mpi decaying-triangle.csv --set n_operators=4 -o mpi.json",),
    "compare": ("compare train.csv --test test.csv --models pi,mpi --jobs 1 -o out",),
    "compare-example": (
        "compare decaying-triangle.csv --test irregular-triangle.csv --models pi,mpi --jobs 1",
    ),
    "compare-load": (
        "compare lifted-1.csv lifted-2.csv lifted-3.csv --test lifted-4.csv --load force "
        "--models coupled-memory,mpi --jobs 1",
    ),
    "plan": ("plan train.csv --minutes 1 -o next.csv",),
    "simulate": ("simulate model.json test.csv -o out.csv",),
    "simulate-inverse": (INVERT, "simulate inverse.json test.csv -o out.csv"),
    "check": ("check model.json test.csv -o checked",),
    "calibrate": ("calibrate model.json train.csv test.csv -o banded.json",),
    "simulate-interval": (
        "calibrate model.json train.csv test.csv -o banded.json",
        "simulate banded.json test.csv --interval 0.75 -o out.csv",
    ),
    "invert": (INVERT,),
    "invert-force": ("invert balance.json --for force -o estimate.json",),
    "invert-adaptive": ("invert model.json --adaptive -o adaptive.json",),
    "invert-predictive": ("invert model.json --predictive --rate-limit 5 -o predictive.json",),
    "track-twin": (INVERT, LOOP),
    "track-log": (INVERT, f"{LOOP} --noise 0.05 -o log.csv"),
    "track-rig": (INVERT, "track inverse.json --rig mas20-hanging --reference test.csv"),
    "study": ("study train.csv --test test.csv --models pi,mpi --jobs 1 -o study",),
    "study-quick": ("study train.csv --test test.csv --quick --jobs 1 -o study",),
    "review": (
        INVERT,
        f"{LOOP} --noise 0.05 -o log.csv",
        "study log.csv --compensator inverse.json --models pi --jobs 1 -o review",
    ),
    "export-c": (INVERT, "export c inverse.json -o muscle --name muscle --float32"),
    "export-fmu": ("export fmu model.json -o NAME.fmu",),
    "export-ros2": (INVERT, "export ros2 inverse.json -o controller"),
    "muscles-list": ("muscles list",),
    "muscles-show": ("muscles show mas20-hanging",),
    "rig-list": ("rig list",),
    "rig-show": ("rig show rail",),
    "rig-run": (
        "rig run mas20-hanging --signal triangle:period=10,peaks=5 --duration 12 --rate 20 -o run.csv",
    ),
    "rig-record": ("rig record field-models -o runs",),
    "reproduce-list": ("reproduce --list",),
}
"""Case -> commands in a folder with recordings and models; the last one's JSON is compared."""

SLOW = {"plan"}

TOOLS = {"export-fmu": ("cc",)}
"""Case -> tools without which it is not compared."""

REFUSED: Mapping[str, str] = {
    "no-such-file": "info missing.csv",
    "no-such-channel": "characterize train.csv --input voltage",
    "no-such-model": "fit gpu train.csv -o model-2.json",
    "no-such-unit": "info train.csv --unit pressure=parsec",
    "no-such-option": "info train.csv --speed 3",
    "would-overwrite": "invert model.json -o model.json",
    "shared-samples": "compare train.csv --test train.csv --models pi --jobs 1",
    "no-inverse": "invert network.json -o inverse.json",
    "no-such-rig": "rig show nothing",
    "no-such-setting": "fit pi train.csv --set n_operator=3 -o pi.json",
}
"""Case -> a command that must refuse its input, with exit code 2, and write nothing."""

LEFT_OUT = {
    *("seconds", "fit_seconds", "step_ns", "step_time", "sha256", "version", "n_evaluations"),
    *("condition", "self_test", "emulation", "standard_errors", "parameter_names"),
}
"""Keys of what differs from run to run, or is known too roughly to be compared."""

NUMBERS = 24
"""Longer lists are compared by their length and ends, those of numbers by their RMS as well."""

TOLERANCES = {
    "*n_effective": 0.005,  # no whole number
    "n_*": 0.0,
    "*/n_*": 0.0,
    "*interval*": 0.01,  # of a bootstrap, which is seeded: one of its samples more or less
    "*": 0.005,
}


def shown(value: Any, key: str = "") -> Tree:
    """Return what is compared of JSON: of sentences that they are some, of paths their last name."""
    if isinstance(value, Mapping):
        return {k: shown(v, k) for k, v in value.items() if k not in LEFT_OUT}
    if isinstance(value, list):
        if any(isinstance(one, str) and " " in one for one in value):
            return "sentences"
        if len(value) > NUMBERS and all(isinstance(one, int | float) for one in value):
            return _of_many(np.array(value, dtype=float))
        if len(value) > NUMBERS:
            return {"n_values": len(value), "first": shown(value[0]), "last": shown(value[-1])}
        return [shown(one, key) for one in value]
    if isinstance(value, str):
        return "words" if " " in value else PurePath(value).name
    if isinstance(value, float) and re.match(r"p_", key):
        return "p < 0.001" if value < 0.001 else "p < 0.05" if value < 0.05 else "p >= 0.05"
    return value


def _of_many(values: np.ndarray) -> dict[str, Tree]:
    return {
        "n_values": values.size,
        "first": values[0],
        "last": values[-1],
        "rms": float(np.sqrt(np.mean(values**2))),
    }


def prepared(folder: Path) -> None:
    """Write what commands are called on."""
    for name, recording in zip(("train", "test"), runs("muscle"), strict=True):
        mckibben.write(recording, folder / f"{name}.csv")
    for number, recording in enumerate(runs("lifted"), start=1):
        mckibben.write(recording, folder / f"lifted-{number}.csv")
    for path in (example.TRAIN, example.TEST):
        (folder / path.name).write_bytes(path.read_bytes())
    (folder / "model.json").write_text(json.dumps(MODEL))
    other = MODEL | {"weights": [9.0, 6.0, 1.5, 2.0, 3.0]}
    (folder / "other.json").write_text(json.dumps(other))
    mckibben.Polynomial((1.0, 0.0, 2.0)).save(folder / "network.json")
    block_example("balance").save(folder / "balance.json")


def commanded(commands: Sequence[str], folder: Path) -> Tree:
    """Return what the last of some commands answers, which files it leaves, and what is in them."""
    prepared(folder)
    for words in commands[:-1]:
        first = call(*shlex.split(words), folder=folder)
        if first.code:
            raise RuntimeError(first.err)
    before = set(folder.rglob("*"))
    found = shown(rounded(answered(*shlex.split(commands[-1]), folder=folder)))
    made = [path for path in folder.rglob("*") if path not in before]
    left = sorted({path.relative_to(folder).parts[0] for path in made})
    inside = written(made, folder, LEFT_OUT)
    return {"answer": found, "left": left} | ({"written": inside} if inside else {})


def refused(words: str, folder: Path) -> Tree:
    """Return how a command refuses what it cannot do."""
    prepared(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    result = call(*shlex.split(words), folder=folder)
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return {
        "code": result.code,
        "said": bool(result.err),
        "out": bool(result.out),
        "touched": sorted(p.name for p in after if before.get(p) != after[p]),
    }


def cases() -> Iterator[Case]:
    """Yield commands, and what they refuse."""
    for name, commands in COMMANDS.items():
        call_ = "; ".join(f"mckibben {words}" for words in commands)
        yield Case(
            f"commands/{name}",
            f"{call_} --json",
            partial(commanded, commands),
            {f"answer/{key}": value for key, value in TOLERANCES.items()}
            | {"written/*/n_values": 0.0, "*": 0.005},
            tools=TOOLS.get(name, ()),
            slow=name in SLOW,
            one_machine=name == "review",
        )
    for name, words in REFUSED.items():
        yield Case(f"commands/refused/{name}", f"mckibben {words}", partial(refused, words))
