"""mckibben info: what models there are, and what a file holds."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Inputs, Json, Outputs, Reading
from mckibben.cli.output import print_json, print_table, say
from mckibben.errors import DataError

if TYPE_CHECKING:
    from mckibben.diagnosis.data_gaps import Gap
    from mckibben.files.choosing import Seen
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
    as_json: Json = False,
) -> None:
    """List the models, or show what files contain, and what recordings cannot identify."""
    if models:
        _models(as_json)
    elif not files:
        raise DataError("there is nothing to tell about", remedy="give a file, or --models")
    elif len(files) == 1 and files[0].suffix.lower() == ".json" and not _is_columns(files[0]):
        _model(files[0], as_json)
    elif known := _named(files):
        raise DataError(
            f"{known!r} is a model, and there is no file of that name",
            remedy="say mckibben info --models for the models, or give a file",
        )
    else:
        named = [*(inputs or ()), *(outputs or ())] or None
        recordings, columns = reading.look(files, named)
        gaps = _gaps(recordings, inputs, outputs)
        _recordings(recordings, columns, gaps, as_json)


def _named(files: list[Path]) -> str:
    """Return the first that is no file, but a model's name; empty if there is none."""
    from mckibben import registry

    models = {*registry.names("estimators"), *registry.names("blocks")}
    return next((str(file) for file in files if str(file) in models and not file.exists()), "")


def _is_columns(file: Path) -> bool:
    """Tell whether a JSON file holds columns of samples rather than a model."""
    from mckibben.files import columns_of

    try:
        return bool(columns_of(file))
    except DataError:
        return False


def _models(as_json: bool) -> None:
    from mckibben import registry
    from mckibben.estimators.catalogue import defaults, summary

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
    from mckibben.blocks.force.feedforward import compensator
    from mckibben.blocks.saving import load
    from mckibben.blocks.setting import settable

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
        "settable": settable(block),
    }
    if as_json:
        print_json(described)
        return
    described["settable"] = ", ".join(f"{name}={value}" for name, value in settable(block).items())
    print_table(["", "value"], [[key, str(value)] for key, value in described.items()])


def _gaps(
    recordings: list[Recording], inputs: list[str] | None, outputs: list[str] | None
) -> tuple[Gap, ...] | str:
    """Return what recordings cannot identify, or, if nothing was asked by name, why that is unknown."""
    from mckibben.diagnosis.data_gaps import data_gaps

    try:
        return data_gaps(recordings, inputs, outputs)
    except DataError as error:
        if inputs or outputs:
            raise
        return str(error)


def _recordings(
    recordings: list[Recording],
    columns: dict[str, list[Seen]],
    gaps: tuple[Gap, ...] | str,
    as_json: bool,
) -> None:
    from mckibben.files.condition import condition
    from mckibben.report.words import gap_run, gap_sentence

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
                    **condition(samples),
                }
                for name, samples in recording.channels.items()
            },
            "meta": dict(recording.meta),
        }
        for recording in recordings
    ]
    if as_json:
        told = gaps if isinstance(gaps, str) else [gap.to_dict() for gap in gaps]
        files = {file: [asdict(column) for column in found] for file, found in columns.items()}
        print_json({"files": files, "recordings": described, "data_gaps": told})
        return
    for file, found in columns.items():
        say(file)
        rows = [
            [one.header, one.unit or "-", ", ".join(one.first), one.channel or "-"] for one in found
        ]
        print_table(["column", "unit", "first cells", "read as"], rows)
    for recording, about in zip(recordings, described, strict=True):
        say(repr(recording))
        rows = [
            [
                name,
                one["unit"] or "-",
                *(f"{one[end]:.6g}" for end in ("min", "max")),
                f"{100 * one['saturated']:.3g} %",
                str(one["stuck"]),
            ]
            for name, one in about["channels"].items()
        ]
        print_table(["channel", "unit", "lowest", "highest", "at a limit", "stuck samples"], rows)
        for note in recording.notes:
            say(f"Note: {note}")
    say()
    if isinstance(gaps, str):
        say(f"Data gaps: unknown, {gaps}")
        return
    say("Data gaps:" if gaps else "Data gaps: none")
    for gap in gaps:
        say(f"- {gap_sentence(gap)} {gap_run(gap)}")
