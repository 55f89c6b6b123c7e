"""mckibben info: what models there are, and what a file holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mckibben.cli.options import Columns, GapPolicy, Gaps, Json, Rate, Reading, Resample, Units
from mckibben.cli.output import print_json, print_table, say
from mckibben.errors import DataError


def info(
    file: Annotated[
        Path | None, typer.Argument(help="A recording, or a model saved as JSON.")
    ] = None,
    models: Annotated[bool, typer.Option("--models", help="List the models and settings.")] = False,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    as_json: Json = False,
) -> None:
    """List the models, or say what a recording or a model file holds."""
    if models:
        _models(as_json)
    elif file is None:
        raise DataError("there is nothing to tell about", remedy="give a file, or --models")
    elif file.suffix.lower() == ".json":
        _model(file, as_json)
    else:
        _recordings(
            Reading(column, unit, rate, gaps, resample).read([file], None, informative=False),
            as_json,
        )


def _models(as_json: bool) -> None:
    import dataclasses

    from mckibben import registry

    found = {}
    for group, name in ((g, n) for g in ("estimators", "coupled") for n in registry.names(g)):
        estimator = registry.load(group, name)
        settings = {
            field.name: field.default
            for field in dataclasses.fields(estimator)
            if field.default is not dataclasses.MISSING
        }
        found[name] = {"summary": estimator.__doc__.strip().splitlines()[0], "settings": settings}
    if as_json:
        print_json(found)
        return
    print_table(["model", "what it is"], [[name, f["summary"]] for name, f in found.items()])
    for name, described in found.items():
        listed = ", ".join(f"{key}={value}" for key, value in described["settings"].items())
        say(f"\n{name} settings (--set NAME=VALUE): {listed}")


def _model(file: Path, as_json: bool) -> None:
    from mckibben.blocks.saving import load

    block = load(file)
    try:
        block.inverse()
        inverse = "yes"
    except Exception as error:
        inverse = f"no: {error}"
    described: dict[str, Any] = {
        "kind": block.kind,
        "inputs": [f"{channel.name} [{channel.unit}]" for channel in block.inputs],
        "outputs": [f"{channel.name} [{channel.unit}]" for channel in block.outputs],
        "n_parameters": block.n_parameters,
        "n_states": block.n_states,
        "rate_dependent": bool(block.rate_dependent),
        "inverse": inverse,
    }
    if as_json:
        print_json(described)
        return
    print_table(["", "value"], [[key, str(value)] for key, value in described.items()])


def _recordings(recordings: list[Any], as_json: bool) -> None:
    described = [
        {
            "name": recording.name,
            "n_samples": recording.n_samples,
            "sample_time": recording.sample_time,
            "start_time": recording.start_time,
            "channels": {
                name: {
                    "unit": recording.units[name],
                    "min": float(samples.min()),
                    "max": float(samples.max()),
                }
                for name, samples in recording.channels.items()
            },
            "meta": dict(recording.meta),
        }
        for recording in recordings
    ]
    if as_json:
        print_json(described)
        return
    for recording in recordings:
        say(str(recording))
        rows = [
            [name, recording.units[name] or "-", f"{s.min():.6g}", f"{s.max():.6g}"]
            for name, s in recording.channels.items()
        ]
        print_table(["channel", "unit", "lowest", "highest"], rows)
        for note in recording.notes:
            say(f"Note: {note}")
