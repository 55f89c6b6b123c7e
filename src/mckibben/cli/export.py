"""mckibben export: a model as C99, as an FMU, or as a package of ROS 2."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben.cli.options import Fields, Json, loaded
from mckibben.cli.output import print_json, say

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.export.c.serving import Serving

app = typer.Typer(
    name="export",
    help="A model as code for elsewhere: c, fmu, ros2.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)

Model = Annotated[
    Path, typer.Argument(metavar="MODEL", help="Model, inverse or controller (JSON).")
]
Name = Annotated[
    str | None, typer.Option("--name", help="Of functions and files. Default: the file's name.")
]
SampleTime = Annotated[
    float | None,
    typer.Option("--sample-time", metavar="SECONDS", help="Time between steps, where it matters."),
]
Inverse = Annotated[bool, typer.Option("--inverse", help="Export the model's inverse.")]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace what an export wrote there before.")
]


def _loaded(model: Path, fields: list[str] | None, inverse: bool) -> Block:
    from mckibben.blocks.force.feedforward import compensator

    block = loaded(model, fields)
    return compensator(block) if inverse else block


def _emulated(block: Block, sample_time: float | None) -> str:
    from mckibben.errors import ModelError
    from mckibben.export.c.emulation import emulate as run
    from mckibben.export.c.project import TOLERANCES

    found = run(block, sample_time=sample_time)
    if not found.difference <= float(TOLERANCES[True]):
        raise ModelError(
            f"{found}: these are not Python's numbers", remedy="use double precision, or report it"
        )
    return str(found)


def _serving(
    link: bool,
    limit: list[str],
    safe: list[str],
    watchdog: float | None,
) -> Serving | None:
    """Return how the model is served, where it is."""
    from mckibben.errors import ModelError
    from mckibben.export.c.serving import Serving

    if not link:
        if limit or safe or watchdog is not None:
            raise ModelError(
                "--limit, --safe and --watchdog are of a served model", remedy="add --link"
            )
        return None
    limits = {}
    for text in limit:
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        limits[name] = (_number(low, f"--limit {text}"), _number(high, f"--limit {text}"))
    values = {
        name: _number(value, f"--safe {text}")
        for text in safe
        for name, _, value in [text.partition("=")]
    }
    return Serving(limits, values, 0.5 if watchdog is None else watchdog)


def _number(text: str, said: str) -> float:
    from mckibben.errors import ModelError

    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ModelError(
            f"{said[:60]!r} says no limits",
            remedy="give --limit NAME=LOW:HIGH or --safe NAME=VALUE, such as pressure=0:6",
        )
    return found


@app.command("c")
def export_c(
    model: Model,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder to write.")],
    name: Name = None,
    sample_time: SampleTime = None,
    float32: Annotated[bool, typer.Option("--float32", help="Single precision.")] = False,
    inverse: Inverse = False,
    fields: Fields = None,
    check: Annotated[
        bool, typer.Option("--check", help="Compile it here and run its self-test.")
    ] = False,
    emulate: Annotated[
        bool,
        typer.Option(
            "--emulate", help="Run it on an emulated Cortex-M4F too, in single precision (QEMU)."
        ),
    ] = False,
    link: Annotated[
        bool, typer.Option("--link", help="Add a server that answers over a serial line.")
    ] = False,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            metavar="NAME=LOW:HIGH",
            help="With --link: of a channel; repeatable. Default: what the model knows.",
        ),
    ] = None,
    safe: Annotated[
        list[str] | None,
        typer.Option(
            "--safe",
            metavar="NAME=VALUE",
            help="With --link: an output while no host leads; repeatable. Default: its lowest.",
        ),
    ] = None,
    watchdog: Annotated[
        float | None,
        typer.Option(help="With --link: silence after which outputs are safe [s]. Default: 0.5."),
    ] = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write C99 that compiles as it is: on a PC, a microcontroller, Arduino, MATLAB."""
    from mckibben.export import export_c as write_c
    from mckibben.export.folders import refuse_folder
    from mckibben.export.naming import name_from
    from mckibben.export.programs import self_test
    from mckibben.outputs import refuse_inputs

    chosen = name or name_from(model)
    serving = _serving(link, limit or [], safe or [], watchdog)
    refuse_inputs(out, [model])
    refuse_folder(out, overwrite=overwrite)
    block = _loaded(model, fields, inverse)
    write_c(
        block,
        out,
        name=chosen,
        sample_time=sample_time,
        single=float32,
        overwrite=overwrite,
        serving=serving,
    )
    told = self_test(out, chosen) if check else None
    ran = _emulated(block, sample_time) if emulate else None
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    if as_json:
        print_json(
            {"folder": str(out), "name": chosen, "files": files, "self_test": told}
            | {"emulation": ran}
        )
        return
    for line in filter(None, (told, ran)):
        say(line)
    say(f"Written: {out} ({len(files)} files; start with {out / 'README.md'})")


@app.command("fmu")
def export_fmu(
    model: Model,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="FMU to write (.fmu).")],
    name: Name = None,
    sample_time: SampleTime = None,
    inverse: Inverse = False,
    fields: Fields = None,
    platforms: Annotated[
        str,
        typer.Option(
            "--platforms",
            metavar="all|none|NAME,...",
            help="linux, windows, macos; all that can be built here, or none.",
        ),
    ] = "all",
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write an FMU for co-simulation, for Simulink-like tools: C inside, libraries built here."""
    import zipfile

    from mckibben.export import export_fmu as write_fmu
    from mckibben.export.fmu.unit import refuse_file
    from mckibben.export.naming import name_from
    from mckibben.outputs import refuse_inputs

    refuse_inputs(out, [model])
    refuse_file(out, overwrite=overwrite)
    named = [word.strip() for word in platforms.split(",")]
    write_fmu(
        _loaded(model, fields, inverse),
        out,
        name=name or name_from(model),
        sample_time=sample_time,
        platforms=None if platforms == "all" else [] if platforms == "none" else named,
        overwrite=overwrite,
    )
    with zipfile.ZipFile(out) as archive:
        built = [path for path in archive.namelist() if path.startswith("binaries/")]
    if as_json:
        print_json({"file": str(out), "fmi": "2.0", "libraries": built})
        return
    for path in built:
        say(f"Library: {path}")
    say(f"Written: {out} (FMI 2.0)")


@app.command("ros2")
def export_ros2(
    model: Model,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder to write.")],
    name: Name = None,
    sample_time: SampleTime = None,
    inverse: Inverse = False,
    fields: Fields = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Write a package of ROS 2: a chainable controller of ros2_control around the model's C."""
    from mckibben.export import export_ros2 as write_package
    from mckibben.export.folders import refuse_folder
    from mckibben.export.naming import name_from
    from mckibben.outputs import refuse_inputs

    refuse_inputs(out, [model])
    refuse_folder(out, overwrite=overwrite)
    chosen = name or name_from(model).lower()
    block = _loaded(model, fields, inverse)
    write_package(block, out, name=chosen, sample_time=sample_time, overwrite=overwrite)
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    if as_json:
        print_json({"folder": str(out), "name": chosen, "files": files})
        return
    say(f"Written: {out} ({len(files)} files; start with {out / 'README.md'})")
