"""Names that users of other tools try first, and ours for them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType

MODULE = {
    "report": "write_report",
    "untold": "data_gaps",
    "RDPIEstimator": "estimator('rdpi')",
    "TSFNNEstimator": "estimator('tsfnn')",
    "presets": "estimator(NAME); its class is type(estimator(NAME))",
    "simulators": "export(model, FILE, 'mjcf')",
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
    "summary": "print it",
}
"""Attribute that a model might have -> what there is."""

COMMAND_LINE = {
    "check-block": "In Python: mckibben.check_block",
    "untold": "Use: mckibben info",
    "ros": "Use: mckibben export ros2",
    "rig new": "Use: mckibben rig show NAME -o FILE",
    "export --overwrite": "Use --force",
    "export --fmi": "FMUs are FMI 2.0",
    "export --platforms": "An FMU has the library for this machine, or none with --no-library",
    "export --adjustable": "Change the model, and export it again",
    "export --sheet": "Write a rig of the sheet, and export a balance fitted to it",
    "characterize --beside": "Use --scheduling",
    "reproduce --train": "Use --data FOLDER",
    "reproduce --test": "Use --data FOLDER",
    "fit --method": "Use --set method=...",
    "simulate --horizon": "All simulations are free runs",
    "invert --flow-limit": "A limit is of one muscle: --rate-limit",
    "invert --total-limit": "A limit is of one muscle: --rate-limit",
    "app --host": "The workbench is for this machine alone",
    "compare --dask": "In Python: mckibben.compare(..., executor=...)",
    "compare --folds": "Eight parts of the training data are left out in turn",
    "compare --n-folds": "Eight parts of the training data are left out in turn",
    "study --folds": "Eight parts of the training data are left out in turn",
    "study --n-folds": "Eight parts of the training data are left out in turn",
    "plan --for": "A plan is for every model",
    "plan --model": "A plan is for every model",
    "plan --muscle": "A plan is for every model",
}
"""Command, or command and option, of earlier versions -> what to do now."""

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

INNER = ("face", "drawn")
"""Attributes for the package alone."""

ALIKE = 0.78
"""Similarity of letters above which one name is taken for another."""

HINTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {"mckibben": MODULE, "recording": RECORDING, "block": BLOCK}
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


def former(command: Sequence[str], word: str) -> str:
    """Return what to do instead of a command or an option that there was; empty if there was none.

    >>> former(["export", "c"], "--overwrite")
    'Use --force'
    """
    keys = (" ".join([*command[:n], word]) for n in range(len(command), -1, -1))
    return next((COMMAND_LINE[key] for key in keys if key in COMMAND_LINE), "")


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
