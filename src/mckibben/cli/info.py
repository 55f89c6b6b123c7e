"""mckibben info: what models there are, and what a file holds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Json, Reading
from mckibben.cli.output import print_json, print_table, say
from mckibben.errors import DataError


@spread
def info(
    reading: Reading,
    file: Annotated[
        Path | None, typer.Argument(help="A recording, or a model saved as JSON.")
    ] = None,
    models: Annotated[bool, typer.Option("--models", help="List the models and settings.")] = False,
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
            reading.read([file], None, informative=False),
            as_json,
        )


def _models(as_json: bool) -> None:
    from mckibben import registry
    from mckibben.comparison.offered import defaults, summary

    found = {
        name: {"summary": summary(name), "settings": defaults(name)}
        for name in registry.names("estimators")
    }
    if as_json:
        print_json(found)
        return
    print_table(["model", "what it is"], [[name, summary(name)] for name in found])
    for name in found:
        listed = ", ".join(f"{key}={value}" for key, value in defaults(name).items())
        say(f"\n{name} settings (--set NAME=VALUE): {listed}")


def _model(file: Path, as_json: bool) -> None:
    from mckibben.blocks.core.saving import load

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
