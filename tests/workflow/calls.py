"""A call of every operation, and of every option a value other than the default that has an effect."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import click
import numpy as np

import mckibben
from mckibben import GPI, PI, MckibbenError, Recording, registry, write
from mckibben.options import (
    COptions,
    ExportOptions,
    FMUOptions,
    MJCFOptions,
    ReproduceOptions,
    StudyOptions,
)
from mckibben.signals import triangle
from mckibben.system.atomic import plain
from mckibben.workflow import OPERATIONS, export
from tests.cli.calls import commands
from tests.export.muscle import MUSCLE

Given = dict[str, Any]


class CaughtError(MckibbenError):
    """What a spied function was called with."""


@dataclass(frozen=True)
class Use:
    """A value of an option, and the call in which it has an effect.

    Parameters
    ----------
    value : object
        Other than the default.
    base : dict
        Options that are given with it and without it; None takes one away.
    args : tuple of str, optional
        Other arguments.
    spy : str
        Function, ``module:name``, whose arguments are the effect, where that of running it is slow, or
        is none of the result's.
    """

    value: Any
    base: Given = field(default_factory=dict)
    args: tuple[Any, ...] | None = None
    spy: str = ""


@dataclass(frozen=True)
class Call:
    """A call of an operation.

    Parameters
    ----------
    run : callable
    kind : type or None
        Dataclass of its options.
    args : tuple of str
        Arguments of both the function and the command.
    out : str
        What it writes.
    base : dict
        Options that are always given.
    flagged : tuple of str
        Parameters that are flags of the command and arguments of the function, in order, after ``args``.
    """

    run: Callable[..., Any]
    kind: type | None
    args: tuple[Any, ...]
    out: str = ""
    base: Given = field(default_factory=dict)
    flagged: tuple[str, ...] = ()


def operation(name: str, *args: str, out: str = "", flagged: str = "", **base: Any) -> Call:
    found = OPERATIONS[name]
    return Call(found.run, found.options, args, out, base, tuple(flagged.split()))


def exported(target: str, kind: type, model: str, out: str, **base: Any) -> Call:
    def run(model: str, *, out: str, **given: Any) -> Any:
        return export(model, out, target, **given)  # type: ignore[arg-type]

    return Call(run, kind, (model,), out, base)


CALLS: dict[str, Call] = {
    "characterize": operation("characterize", "run.csv"),
    "fit": operation("fit", "pi", "run.csv", out="out.json"),
    "compare": operation("compare", "run.csv", "two.csv", flagged="test", models="pi", jobs=1),
    "check": operation("check", "model.json", "run.csv", out="out"),
    "calibrate": operation("calibrate", "model.json", "run.csv", out="out.json"),
    "simulate": operation("simulate", "model.json", "run.csv", out="out.csv"),
    "invert": operation("invert", "model.json", out="out.json"),
    "track": operation("track", "inverse.json", "short.csv", out="out.csv", flagged="reference",
                       plant="model.json", approach=1.0),
    "learn": operation("learn", "inverse.json", "log.csv", out="out.json"),
    "review": operation("review", "log.csv", compensator="inverse.json", refit=False),
    "plan": operation("plan", "run.csv", out="out.csv", minutes=0.5),
    "plot": operation("plot", "run.csv", out="out.svg"),
    "info": Call(mckibben.info, mckibben.options.ChannelOptions, ("run.csv",)),
    "data_gaps": Call(mckibben.data_gaps, mckibben.options.ChannelOptions, ("run.csv",)),
    "study": Call(mckibben.study, StudyOptions, ("run.csv", "two.csv"), "out",
                  {"models": "pi", "jobs": 1}, ("test",)),
    "reproduce": Call(mckibben.reproduce, ReproduceOptions, ("field-models",), "", {"quick": True}),
    "export c": exported("c", COptions, "model.json", "out"),
    "export fmu": exported("fmu", FMUOptions, "model.json", "out.fmu", library=False),
    "export ros2": exported("ros2", ExportOptions, "inverse.json", "out"),
    "export mjcf": exported("mjcf", MJCFOptions, "muscle.json", "out.xml", rest_length=200.0),
}  # fmt: skip

RERUN = "mckibben.system.workers:Workers.results"
COMPARED = "mckibben.comparison.ranking:compare"
STUDIED = "mckibben.studying.study:plan_of"
ABSENT = {"input": Use("voltage"), "output": Use("absent")}
CHANNELS = {"input": Use("voltage"), "output": Use("angle")}
COMPARE = {
    "load": Use("force", args=("held.csv", "held2.csv")),
    "models": Use("pi,gpi", {"models": None}, spy="mckibben.comparison.ranking:ranked"),
    "settings": Use({"pi.n_operators": 3}),
    "seed": Use(3),
    "jobs": Use(0),
    "most_samples": Use(120),
    "allow_shared": Use(True, args=("run.csv", "run.csv")),
    "quick": Use(True, {"models": None}, spy=COMPARED),
}
LOG = {"models": "pi", "input": None}
EXPORT = {
    "name": Use("other"),
    "sample_time": Use(0.5, args=("rated.json",)),
    "inverse": Use(True, args=("model.json",)),
    "fields": Use({"rate_time_constant": 0.25}, {"sample_time": 0.5}, args=("rated.json",)),
}
SERVED = {"link": True, "sample_time": 0.01}
ADAPTIVE, PREDICTIVE = {"adaptive": True}, {"predictive": True}

USES: dict[str, dict[str, Use]] = {
    "info": ABSENT,
    "data_gaps": ABSENT,
    "characterize": CHANNELS | {"scheduling": Use(("voltage",))},
    "fit": {
        **CHANNELS,
        "prior": Use("rail"),
        "residual_of": Use("model.json"),
        "target": Use("mjcf"),
        "settings": Use({"n_operators": 3}),
        "seed": Use(3),
    },
    "compare": CHANNELS | COMPARE,
    "study": {
        **{name: Use(one.value, one.base, one.args, STUDIED) for name, one in
           (CHANNELS | COMPARE).items()},
        "jobs": Use(0),
        "quick": Use(True, {"models": None}, spy=STUDIED),
        "rig": Use("mas20-hanging"),
        "compensator": Use("inverse.json", args=("log.csv", "log2.csv"),
                           spy="mckibben.studying.study:review"),
        "model": Use("model.json", args=("log.csv", "log2.csv"),
                     spy="mckibben.studying.study:review"),
        "title": Use("Another", spy="mckibben.report.results_folder:StudyFolder"),
    },
    "track": {
        "rig": Use("mas20-hanging", {"plant": None}, spy="mckibben.control:track"),
        "plant": Use("model.json", {"plant": None}),
        "limits": Use({"pressure": (0.0, 2.0)}),
        "controller": Use("feedforward-pid"),
        "repetitions": Use(1),
        "approach": Use(2.0, spy="mckibben.control:track"),
        "settle": Use(0.5),
        "noise": Use(0.1, {"controller": "feedforward-pid"}),
        "delay": Use(3, {"controller": "feedforward-pid"}),
        "slew": Use(0.5),
        "preview": Use(0.3),
        "pressure_loop": Use(False, spy="mckibben.control:track"),
        "controller_out": Use("controller.json"),
        "fields": Use({"a_field": 1.0}),
        "seed": Use(3, {"controller": "feedforward-pid", "noise": 0.1}),
    },
    "learn": {"ahead": Use(2), "repeats": Use(True, args=("inverse.json", ("log.csv", "log2.csv"))),
              "best": Use(True)},
    "simulate": {
        "initial": Use("virgin"),
        "interval": Use(0.5, args=("banded.json", "run.csv")),
        "fields": Use({"rate_time_constant": 0.5}, args=("rated.json", "run.csv")),
    },
    "calibrate": {"exchangeable": Use("run"), "fitted": Use("run.csv")},
    "review": {
        "model": Use("model.json", {"compensator": None}),
        "compensator": Use("inverse.json", {"compensator": None}),
        "refit": Use(True),
        "seed": Use(3, spy="mckibben.diagnosis.review:review"),
    },
    "plot": {**CHANNELS, "model": Use("model.json"), "kind": Use("time"), "width": Use(2)},
    "reproduce": {
        "quick": Use(False, spy=RERUN),
        "rig": Use("mas20-hanging", spy=RERUN),
        "seed": Use(3, spy=RERUN),
        "jobs": Use(2, spy=RERUN),
    },
    "invert": {
        "wanted": Use("force", args=("muscle.json",)),
        "adaptive": Use(True),
        "time": Use(30.0, ADAPTIVE),
        "noise": Use(0.3, ADAPTIVE),
        "predictive": Use(True),
        "horizon": Use(7, PREDICTIVE),
        "rate_limit": Use(2.0, PREDICTIVE),
        "pressures": Use((0.5, 3.0), PREDICTIVE),
        "learned": Use(("run.csv",)),
        "fields": Use({"frequency": 0.25}, args=("activated.json",)),
        "seed": Use(3, {"learned": ("run.csv",)},
                    spy="mckibben.estimators.coupled.sdchm:trained_inverse"),
    },
    "plan": {
        "rig": Use("mas20-hanging", args=()),
        "minutes": Use(1.0, {"minutes": None}),
        "limits": Use({"pressure": (1.0, 4.0)}),
        "seed": Use(3),
    },
    "export c": {
        **EXPORT,
        "force": Use(True, spy="mckibben.exporting:export_c"),
        "single": Use(True),
        "check": Use(True, spy="mckibben.exporting.programs:self_test"),
        "emulate": Use(True, spy="mckibben.exporting.c.emulation:emulate"),
        "link": Use(True, {"sample_time": 0.01}),
        "limits": Use({"pressure": (0.5, 3.0)}, SERVED),
        "safe": Use({"displacement": 1.5}, SERVED),
        "watchdog": Use(2.0, SERVED),
    },
    "export fmu": {
        **EXPORT,
        "force": Use(True, spy="mckibben.exporting:export_fmu"),
        "library": Use(True, {"library": False}, spy="mckibben.exporting:export_fmu"),
    },
    "export ros2": {**EXPORT, "force": Use(True, spy="mckibben.exporting:export_ros2"),
                    "inverse": Use(True, args=("model.json",)),
                    "sample_time": Use(0.5, args=("activated.json",)),
                    "fields": Use({"frequency": 0.25}, {"sample_time": 0.5},
                                  args=("activated.json",))},
    "export mjcf": {
        "rest_length": Use(150.0),
        "site_from": Use("a", {"site_to": "b"}),
        "site_to": Use("b", {"site_from": "a"}),
        "example": Use("joint"),
        "lag": Use(0.1),
        "name": Use("other"),
        "force": Use(True, spy="mckibben.exporting.mjcf:export_mjcf"),
    },
}  # fmt: skip
"""Call -> option -> a value that has an effect."""


def prepare(folder: Path) -> None:
    """Write what the calls read."""
    for name, peaks in (("run", [5.0, 4.0]), ("two", [4.5, 3.5]), ("short", [3.0])):
        u = triangle(np.arange(0, 8 if peaks[1:] else 4, 0.02), 4.0, peaks)
        y = GPI.example().simulate(u) + 0.05 * np.random.default_rng(len(name)).normal(size=u.size)
        channels = {"pressure": u, "displacement": y, "voltage": u**2 / 10, "angle": y**2 / 100}
        if name == "short":
            channels = {"displacement": np.maximum(y, 1.0)}
        write(Recording(channels, 0.02), folder / f"{name}.csv")
    for name, shift in (("log", 0.2), ("log2", 0.3)):
        u = triangle(np.arange(0, 8, 0.02), 4.0, [5.0, 4.0])
        y = GPI.example().simulate(u)
        channels = {"pressure": u, "displacement": y + shift, "reference_displacement": y}
        units = {"reference_displacement": "mm"}
        write(Recording(channels, 0.02, units), folder / f"{name}.csv")
    for name, first in (("held", 10.0), ("held2", 15.0)):
        u = np.concatenate([triangle(np.arange(0, 8, 0.02), 4.0, [5.0, 4.0]) for _ in range(2)])
        load = np.repeat([first, 2 * first], u.size // 2)
        y = GPI.example().simulate(u) - 0.05 * load
        channels = {"pressure": u, "displacement": y, "force": load}
        write(Recording(channels, 0.02), folder / f"{name}.csv")
    GPI.example().save(folder / "model.json")
    GPI.example().inverse().save(folder / "inverse.json")
    PI.example().save(folder / "pi.json")
    mckibben.calibrate(folder / "model.json", folder / "two.csv", out=folder / "banded.json")
    for name, kind in (("rated", "rate-dependent-pi"), ("activated", "activation-pressure")):
        registry.load("blocks", kind).example().save(folder / f"{name}.json")
    MUSCLE.save(folder / "muscle.json")


TIMES = {"seconds", "fit_seconds", "step_ns", "step_time", "file", "folder", "notes"}
"""Keys of what differs between equal runs."""


def scrubbed(found: Any) -> Any:
    """Return JSON values without times, and paths of what was written."""
    if isinstance(found, Mapping):
        return {key: scrubbed(one) for key, one in found.items() if key not in TIMES}
    return [scrubbed(one) for one in found] if isinstance(found, list) else found


def outcome(call: Call, use: Use | None = None, given: Given | None = None) -> Any:
    """Return the numbers and files of a call, what was spied, or the words of a refusal."""
    out = Path(call.out) if call.out else None
    clear(out)
    args = call.args if use is None or use.args is None else use.args
    base = call.base | (use.base if use else {}) | (given or {})
    options = {name: value for name, value in base.items() if value is not None}
    options |= {} if out is None else {"out": out}
    try:
        with spied(use.spy if use else ""):
            found = call.run(*args, **options)
    except CaughtError as caught:
        return str(caught)
    except MckibbenError as error:
        return error
    numbers: Any = plain(found) if isinstance(found, tuple) else {}
    if hasattr(found, "to_dict"):
        numbers = json.loads(json.dumps(plain(found.to_dict())))
    of_fit = getattr(found, "estimator", None)
    return scrubbed(numbers), repr(of_fit and of_fit.get_params()), written(out)


def clear(out: Path | None) -> None:
    """Remove what an earlier call wrote."""
    if out is not None and out.is_dir():
        shutil.rmtree(out)
    elif out is not None:
        out.unlink(missing_ok=True)


def written(out: Path | None) -> dict[str, str]:
    """Return digests of code, models and tables that were written."""
    if out is None or not out.exists():
        return {}
    if out.suffix == ".fmu":  # which has the time when it was made
        with zipfile.ZipFile(out) as archive:
            names = [one for one in archive.namelist() if one.startswith("sources/")]
            return {one: hashlib.sha256(archive.read(one)).hexdigest() for one in names}
    files = [one for one in sorted(out.rglob("*")) if one.is_file()] if out.is_dir() else [out]
    timed = {"run.json", "validation.json", "leaderboard.json", "leaderboard.csv"}
    mine = [
        one
        for one in files
        if one.name not in timed and one.suffix != ".html" and "unfinished" not in one.parts
    ]
    return {str(one): hashlib.sha256(one.read_bytes()).hexdigest() for one in mine}


def spied(spy: str) -> Any:
    """Replace a function, or none, by one that raises what it is called with."""
    if not spy:
        return patch.dict({})  # nothing
    module, _, names = spy.partition(":")
    owner: Any = import_module(module)
    *path, name = names.split(".")
    for one in path:
        owner = getattr(owner, one)

    def caught(*args: Any, **given: Any) -> Any:
        shown = {key: one for key, one in given.items() if key not in ("progress", "found")}
        text = f"{args[1:] if path else args} {shown}"
        raise CaughtError(re.sub(r" at 0x[0-9a-f]+", "", text))  # where an object lies is no effect

    return patch.object(owner, name, caught)


def typed(name: str, use: Use, given: Given) -> list[str]:
    """Return a call as the words of a command line."""
    call = CALLS[name]
    args = [*(call.args if use.args is None else use.args)]
    places = len(args) - len(call.flagged)
    flags = dict(zip(call.flagged, args[places:], strict=False))
    out = ["-o", call.out] if call.out else []
    listed = [one for each in args[:places] for one in ([each] if isinstance(each, str) else each)]
    return [
        *name.split(),
        *listed,
        *out,
        *words_of(name, {**flags, **call.base, **use.base, **given}),
    ]


def words_of(name: str, given: Given) -> list[str]:
    """Return options as words of a command line."""
    command = COMMANDS[name]
    params = {one.name: one for one in command.params if isinstance(one, click.Option)}
    words: list[str] = []
    for key, value in given.items():
        param = params[key]
        flag = param.opts[-1]
        if value is None:
            continue
        if param.is_flag:
            words += [flag if value else param.secondary_opts[-1]]
        elif isinstance(value, Mapping):
            entries = {k: ":".join(map(str, v)) if isinstance(v, tuple) else v
                       for k, v in value.items()}  # fmt: skip
            words += [word for k, v in entries.items() for word in (flag, f"{k}={v}")]
        elif isinstance(value, tuple) and param.multiple:
            words += [word for one in value for word in (flag, str(one))]
        elif isinstance(value, tuple) and param.nargs == len(value):
            words += [flag, *map(str, value)]
        elif isinstance(value, tuple):
            words += [flag, ":".join(map(str, value))]
        else:
            words += [flag, str(value)]
    return words


COMMANDS = dict(commands())
"""Commands by the words that call them."""
