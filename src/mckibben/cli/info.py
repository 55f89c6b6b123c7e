"""mckibben info: what models there are, and what a file holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Inputs, Json, Outputs, Reading
from mckibben.cli.output import print_json, print_table, say
from mckibben.errors import DataError

if TYPE_CHECKING:
    from mckibben.excitation import Gap
    from mckibben.recording import Recording


@spread
def info(
    reading: Reading,
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILES...", help="Recordings, or a model saved as JSON."),
    ] = None,
    models: Annotated[bool, typer.Option("--models", help="List the models and settings.")] = False,
    inputs: Inputs = None,
    outputs: Outputs = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Model, as JSON: which of its parameters the files tell."),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the models, or say what files hold, and what recordings cannot tell of a muscle."""
    if models:
        _models(as_json)
    elif not files:
        raise DataError("there is nothing to tell about", remedy="give a file, or --models")
    elif len(files) == 1 and files[0].suffix.lower() == ".json":
        _model(files[0], as_json)
    else:
        named = [*(inputs or ()), *(outputs or ())] or None
        recordings = reading.read(files, named, informative=False)
        _recordings(recordings, _untold(recordings, inputs, outputs, model), as_json)


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
    from mckibben.blocks.force.feedforward import compensator

    block = load(file)
    try:
        compensator(block)
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


def _untold(
    recordings: list[Recording],
    inputs: list[str] | None,
    outputs: list[str] | None,
    model: Path | None,
) -> tuple[Gap, ...] | str:
    """Return what recordings cannot tell, or, if nothing was asked by name, why that cannot be said."""
    from mckibben.blocks.core.saving import load
    from mckibben.excitation import untold

    try:
        return untold(recordings, inputs, outputs, None if model is None else load(model))
    except DataError as error:
        if inputs or outputs or model:
            raise
        return str(error)


def _recordings(recordings: list[Recording], gaps: tuple[Gap, ...] | str, as_json: bool) -> None:
    described: list[dict[str, Any]] = [
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
            "meta": recording.known,
        }
        for recording in recordings
    ]
    if as_json:
        told = gaps if isinstance(gaps, str) else [gap.to_dict() for gap in gaps]
        print_json({"recordings": described, "untold": told})
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
    say()
    if isinstance(gaps, str):
        say(f"What they cannot tell is not known: {gaps}")
        return
    say(
        "What these recordings cannot tell:" if gaps else "These recordings tell what they need to."
    )
    for gap in gaps:
        say(f"- {gap}")
