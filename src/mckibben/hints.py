"""Names of earlier versions, and those that users of other tools try first, with ours for them."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType, ModuleType
from typing import NoReturn

MODULE = {
    "report": "write_report",
    "untold": "data_gaps",
    "RDPIEstimator": "estimator('rdpi')",
    "TSFNNEstimator": "estimator('tsfnn')",
    "presets": "estimator(NAME); its class is type(estimator(NAME))",
    "simulators": "export(model, FILE, 'mjcf')",
    "bands": "calibrate, which adds a band to a model",
    "characterization": "characterize; its results are in mckibben.diagnosis",
    "excitation": "data_gaps and plan",
    "ros": "export(model, FOLDER, 'ros2')",
    "validation": "check",
    "check_rig": "load_rig, which checks what it reads",
    "rig_from_data_sheet": "load_rig of a file that `mckibben rig show NAME -o FILE` writes",
    "concat": "a list of recordings, which are fitted together",
    "Regressor": "estimator(NAME)",
    "HysteresisRegressor": "estimator(NAME)",
    "Preisach": "estimator('preisach'), or fit",
    "PrandtlIshlinskii": "estimator('pi'), or fit",
    "plot_hysteresis": "plot",
    "load_model": "load",
    "read_csv": "read",
    "read_frame": "read",
    "from_frame": "read, which takes data frames, too",
    "load_data": "read",
    "load_recording": "read",
    "open": "read, or load of a model",
    "iddata": "Recording, or read",
    "Data": "Recording, or read",
    "Dataset": "Recording, or read",
    "to_csv": "write",
    "save": "write of recordings; models have .save(FILE)",
    "save_model": "model.save(FILE)",
    "models_list": "models",
    "list_models": "models",
    "get_model": "estimator, or load of a saved one",
    "create_model": "estimator",
    "make_estimator": "estimator",
    "Estimator": "estimator",
    "identify": "fit",
    "train": "fit",
    "tfest": "fit('p2', ...), or fit('oe', ...)",
    "nlarx": "fit('narx', ...)",
    "resid": "check, for the residuals of a model",
    "residuals": "check, for the residuals of a model",
    "validate": "check",
    "evaluate": "check",
    "predict": "simulate",
    "sim": "simulate",
    "lsim": "simulate",
    "step": "model.stream(sample_time).step",
    "inverse": "invert",
    "compensate": "invert",
    "compensator": "invert",
    "follow": "track",
    "rank": "compare",
    "benchmark": "compare",
    "analyze": "characterize",
    "analyse": "characterize",
    "summary": "info",
    "describe": "info",
    "to_c": "export",
    "export_c": "export(model, FOLDER, 'c')",
    "export_fmu": "export(model, FILE, 'fmu')",
    "generate_code": "export",
    "codegen": "export",
    "simulate_rig": "load_rig(NAME).run(inputs)",
    "rig": "load_rig",
    "paper": "reproduce",
    "split": "recording.between(start, stop), twice; or compare, which holds a part out",
    "train_test_split": "recording.between(start, stop), twice; or compare, which holds a part out",
}
"""Name that might be in `mckibben` -> what is."""

RECORDING = {
    "trim": "run.between(start, stop)",
    "crop": "run.between(start, stop)",
    "cut": "run.between(start, stop)",
    "lowpass": "mckibben.signals.low_pass(run, cutoff)",
    "smooth": "mckibben.signals.low_pass(run, cutoff)",
    "decimate": "run.resample(sample_time)",
    "sampling_rate": "1 / run.sample_time",
    "info": "mckibben.info(run)",
    "cycles": "mckibben.signals.cycles",
    "fit": "mckibben.fit(NAME, run)",
    "hysteresis": "mckibben.characterize(run)",
    "convert": "mckibben.read(run, units={CHANNEL: UNIT})",
    "split": "run.between(start, stop), twice; compare holds a part out by itself",
    "train_test_split": "run.between(start, stop), twice; compare holds a part out by itself",
    "columns": "list(run), or run.channels",
    "keys": "list(run), or run.channels",
    "values": "run.matrix(names), or run.to_frame()",
    "shape": "run.n_samples, and len(run.channels)",
    "iloc": "run.slice(start, stop)",
    "loc": "run[2.0:5.0] of seconds, or run[['pressure']]",
    "head": "run.slice(0, 5).to_frame()",
    "describe": "mckibben.info(run)",
    "dt": "run.sample_time",
    "Ts": "run.sample_time",
    "fs": "1 / run.sample_time",
    "rate": "1 / run.sample_time",
    "t": "run.time",
    "to_pandas": "run.to_frame()",
    "to_dataframe": "run.to_frame()",
    "df": "run.to_frame()",
    "to_csv": "mckibben.write(run, FILE)",
    "save": "mckibben.write(run, FILE)",
    "to_numpy": "run.matrix(names)",
    "u": "run['pressure']",
    "y": "run['displacement']",
    "pressure": "run['pressure']",
    "displacement": "run['displacement']",
    "force": "run['force']",
    "filter": "mckibben.signals.low_pass(run, cutoff)",
    "detrend": "mckibben.signals.detrend(run)",
    "interpolate": "run.resample(sample_time)",
    "known": "run.meta",
    "processed": "run.with_channels",
    "continues": "run.start_time",
    "concat": "a list of recordings, which are fitted together",
    "append": "a list of recordings, which are fitted together",
}
"""Attribute that a recording might have -> what there is."""

RESULT = {
    "equation": "model.equations()",
    "equations": "model.equations()",
    "standard_errors": "to_frame()",
    "conf_int": "to_frame()",
    "metrics": "simulate(data).metrics",
    "step": "model.stream(sample_time).step",
    "reset": "model.stream(sample_time), which begins anew",
    "to_fmu": "mckibben.export(it, FILE, 'fmu')",
    "feedforward": "mckibben.invert(it)",
    "predict": "simulate(data)",
    "sim": "simulate(data)",
    "residuals": "mckibben.check(model, data)",
    "resid": "mckibben.check(model, data)",
    "params": "to_frame()",
    "parameters": "to_frame()",
    "coef_": "to_frame()",
    "summary": "print it, or to_dict()",
    "block": "model",
    "model_": "model",
    "best_model": "model",
    "best": "model",
    "inverse": "mckibben.invert(it)",
    "invert": "mckibben.invert(it)",
    "save": ".model.save(FILE)",
    "export": "mckibben.export(it, FOLDER)",
    "to_c": "mckibben.export(it, FOLDER)",
    "rmse": "to_dict()['rmse']",
    "score": "simulate(data).metrics",
    "sentences": "print it, or to_dict()",
    "verdict": "print it, or to_dict()",
    "untold": "mckibben.data_gaps(data)",
    "table": "to_frame()",
    "df": "to_frame()",
}
"""Attribute that a result might have -> what there is."""

BLOCK = {
    "predict": "simulate(recording)",
    "sim": "simulate(recording)",
    "params": "pack(), whose names are parameter_names",
    "coef_": "pack(), whose names are parameter_names",
    "equation": "equations()",
    "residuals": "mckibben.check(model, data)",
    "resid": "mckibben.check(model, data)",
    "score": "mckibben.check(model, data)",
    "invert": "inverse()",
    "fit": "mckibben.fit, which returns a model",
    "step": "stream(sample_time).step",
    "reset": "stream(sample_time), which begins anew",
    "export": "mckibben.export(model, FOLDER)",
    "to_c": "mckibben.export(model, FOLDER)",
    "to_fmu": "mckibben.export(model, FILE, 'fmu')",
    "to_json": "save(FILE), or to_dict()",
    "to_scipy": "to_dict(), whose coefficients scipy.signal takes",
    "to_control": "to_dict(), whose coefficients control.tf takes",
    "limits": "input_bounds",
    "undone": "forward_model",
    "summary": "print it",
}
"""Attribute that a model might have -> what there is."""

FORMER_PACKAGES = {
    "control": {
        "slow_rise": "slow_cycle, whose middle is the static map",
        "dead_time_undone": "preview_time",
        "Feedforward": "control_law('feedforward', compensator, tuned)",
        "FeedforwardPID": "control_law('feedforward-pid', compensator, tuned)",
        "PID": "control_law('pid', compensator, tuned)",
    },
    "link": {
        "open_port": "Link(PORT), which opens a port by pyserial",
        "ByteStream": "Link(PORT), which opens a port by pyserial",
        "Descriptor": "Link(PORT), which opens a port by pyserial",
    },
    "papers": {"reproduce": "mckibben.reproduce"},
    "report": {"write_reproduction": "mckibben.reproduce(PAPER, out=FOLDER)"},
    "rigs": {name: f"mckibben.{MODULE[name]}" for name in ("check_rig", "rig_from_data_sheet")},
    "signals": {
        "random_steps": "staircase of random levels, or random_wave",
        "split_time": "run.between(start, stop), twice",
        "branches_of": "branches, and run.slice(start, stop)",
    },
    "stream": {"UDPLink": "run, with functions of a socket that read and write"},
}
"""Package -> name of earlier versions in it -> what there is instead."""

_EIGHT_PARTS = "leave it out: eight parts of the training data are left out in turn"
_ONE_PLAN = "leave it out: a plan is for every model"
_ONE_MUSCLE = "use `rate_limit`: a limit is of one muscle"
_DRIVEN = "drive the device in Python, by mckibben.link.Link"
_EXECUTOR = "in Python, give an `executor`, such as one of Dask"

FORMER_OPERATIONS = {
    "check-block": "in Python, use mckibben.check_block",
    "untold": "use `info()`",
    "ros": "use `export()` ros2",
    "rig new": "use mckibben rig show NAME -o FILE",
    "--folder": "use `out`",
    "--path": "give data first, without a name",
    "--recordings": "give data first, without a name",
    "--clear": "leave it out: models of an interrupted run are in `out`",
    "--found": "leave it out: `progress` shows how far it is",
    "--watch": "leave it out: `progress` shows how far it is",
    "--notes": "leave it out: notes are those of the recordings",
    "app --host": "leave it out: the workbench is for this machine alone",
    "app --token": "leave it out: a new link opens the workbench each time",
    "characterize --beside": "use `scheduling`",
    "compare --dask": _EXECUTOR,
    "compare --folds": _EIGHT_PARTS,
    "compare --n-folds": _EIGHT_PARTS,
    "export --adjustable": "change the model, and export it again",
    "export --fmi": "leave it out: FMUs are FMI 2.0",
    "export --overwrite": "use `force`",
    "export --platforms": "leave it out: an FMU has the library for this machine",
    "export --sheet": "write a rig of the sheet, and export a balance fitted to it",
    "fit --method": "use `settings[method]=...`, of the models that have it",
    "fit --validation": "leave it out: fits have no early stopping",
    "info --model": "use `fit()`, which shows the standard error of every parameter",
    "invert --flow-limit": _ONE_MUSCLE,
    "invert --total-limit": _ONE_MUSCLE,
    **{
        f"link {flag}": _DRIVEN
        for flag in ("--set", "--seconds", "--out", "-o", "--every", "--force")
    },
    "plan --for": _ONE_PLAN,
    "plan --goal": _ONE_PLAN,
    "plan --model": _ONE_PLAN,
    "plan --progress": "leave it out: a plan takes seconds",
    "plan --muscle": "give recordings, or `rig`",
    "reproduce --test": "use `data`, a folder with all recordings",
    "reproduce --train": "use `data`, a folder with all recordings",
    "rig record --format": "leave it out: recordings are written as CSV",
    "simulate --horizon": "leave it out: all simulations are free runs",
    "study --dask": _EXECUTOR,
    "study --folds": _EIGHT_PARTS,
    "study --n-folds": _EIGHT_PARTS,
}
"""Command, or operation and option, of earlier versions -> what to do now."""

_NO_SWARM = "leave it out: swarms are in mpi-narmax and sdchm-published alone"
_TERMS = "use `settings[terms]`, a list of what may be added"

FORMER_SETTINGS = {
    "balance finest": "use `settings[n_stops]`: the shortest stop is 0.3 % of the stroke",
    "balance contact": _TERMS,
    "balance mass": _TERMS,
    "balance slack": _TERMS,
    "balance ridge": "leave it out: each term has a scale of its own",
    "balance-force contact": _TERMS,
    "cpi settled": "leave it out: all runs begin by one rule",
    "narx-network activation": "leave it out: units are tanh",
    "state-network periodic": "leave it out: `meta['periodic']` of a recording decides",
    "fit_delay": "fit oe or arx, which have a `settings[delay]`, or air, which finds a dead time",
    "fit_pressure_gain": "leave it out: forces of friction do not depend on pressure",
    "hold": "leave it out: inputs are straight lines between samples",
    "method": _NO_SWARM,
    **{f"pso_{one}": _NO_SWARM for one in ("c1", "c2", "inertia_start", "inertia_end", "iterations",
                                           "particles")},
    "spacing": "leave it out: thresholds are spaced evenly",
}  # fmt: skip
"""Setting of estimators of earlier versions, of one model or of any -> what to do now."""

_OSCILLATOR = "fit {}, or 'state-network'; saved oscillators still load and run"

FORMER_PLUGINS = {
    "blocks force-balance": "use 'balance'",
    "blocks force-balance-inverse": "use 'balance'",
    "estimators bouc-wen-oscillator": _OSCILLATOR.format("'bouc-wen'"),
    "estimators duhem-oscillator": _OSCILLATOR.format("'duhem'"),
    "estimators force-balance": "use 'balance'",
    "estimators grey-box": "use 'balance'",
    "protocols multistate": "use 'multistate-friction'",
    "signals random-steps": "use 'staircase', or 'random-wave'",
}
"""Group and name of plug-ins of earlier versions -> what to do now."""

KEYWORDS = {
    "features": "input",
    "beside": "scheduling",
    "dt": "sample_time",
    "ts": "sample_time",
    "period": "sample_time",
    "fs": "rate",
    "sampling_rate": "rate",
    "sample_rate": "rate",
    "frequency": "rate",
    "x": "input",
    "u": "input",
    "inputs": "input",
    "y": "output",
    "outputs": "output",
    "target_channel": "output",
    "model_name": "model",
    "random_state": "seed",
    "n_jobs": "jobs",
    "workers": "jobs",
    "filename": "out",
    "path": "out",
    "save": "out",
    "output_file": "out",
    "overwrite": "force",
    "verbose": "progress",
    "column": "columns",
    "rename": "columns",
    "unit": "units",
    "models_list": "models",
    "params": "settings",
    "t": "between",
    "window": "between",
}
"""Keyword that might be asked for -> ours."""

INNER = ("face", "drawn", "annotations")
"""Attributes for the package alone."""

ALIKE = 0.78
"""Similarity of letters above which one name is taken for another."""

HINTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "mckibben": MODULE,
        "recording": RECORDING,
        "block": BLOCK,
        **{f"mckibben.{name}": names for name, names in FORMER_PACKAGES.items()},
    }
)


def nearest(name: str, known: Iterable[str], hints: Mapping[str, str] | None = None) -> str:
    """Return what to use in place of a name, or nothing.

    >>> nearest("fs", ["rate", "units"], KEYWORDS), nearest("unts", ["rate", "units"])
    ('rate', 'units')
    """
    found = (hints or {}).get(name) or (hints or {}).get(name.casefold())
    if found:
        return found
    close = get_close_matches(name, [one for one in known if not one.startswith("_")], 1, ALIKE)
    return close[0] if close else ""


def former(
    place: Sequence[str], name: str, among: Mapping[str, str] = MappingProxyType(FORMER_OPERATIONS)
) -> str:
    """Return what to do instead of a name of an earlier version; empty if there was none.

    >>> former(["export", "c"], "--overwrite"), former(["balance"], "ridge", FORMER_SETTINGS)
    ('use `force`', 'leave it out: each term has a scale of its own')
    """
    keys = (" ".join([*place[:n], name]) for n in range(len(place), -1, -1))
    return next((among[key] for key in keys if key in among), "")


def lead_on(package: str) -> None:
    """Make a package lead from names that it has not to what there is instead."""
    names = vars(sys.modules[package])

    def refuse(name: str) -> NoReturn:
        own = [each for each, what in names.items() if not isinstance(what, ModuleType)]
        raise AttributeError(absent(package, name, own, package), name=name)

    names["__getattr__"] = refuse


def absent(owner: str, name: str, known: Iterable[str], kind: str = "") -> str:
    """Return the text of an `AttributeError`, which leads to what there is instead.

    >>> absent("mckibben", "read_csv", [], "mckibben")
    "mckibben has no attribute 'read_csv'. Use read."
    """
    problem = f"{owner} has no attribute {name!r}"
    if name.startswith("_"):
        return problem
    public = [one for one in known if not one.startswith("_") and one not in INNER]
    hint = nearest(name, public, HINTS.get(kind, RESULT))
    first = re.split(r"\W", hint.removeprefix("."))[0]
    if kind not in HINTS and first not in (*public, "mckibben", "print"):
        hint = ""
    every = ", ".join(public)
    return f"{problem}. Use {hint}." if hint else f"{problem}. It has {every}."
