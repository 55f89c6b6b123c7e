"""Export a model as C99 (c), FMU (fmu), ROS 2 package (ros2) or MuJoCo XML (mjcf)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import click

from mckibben.cli.output import show
from mckibben.cli.parameters import Json, command
from mckibben.options import Argument, COptions, ExportOptions, FMUOptions, MJCFOptions, Option

Model = Annotated[Path, Argument("MODEL", "Model, inverse or controller (JSON).")]
Folder = Annotated[Path, Option("Folder to write.", "DIR", "-o")]


@command
def c(model: Model, options: COptions, out: Folder, as_json: Json = False) -> None:
    """Write C99 that compiles as it is: on a PC, a microcontroller, Arduino, MATLAB."""
    _export("c", model, options, out, as_json)


@command
def fmu(
    model: Model,
    options: FMUOptions,
    out: Annotated[Path, Option("FMU to write (.fmu).", "FILE", "-o")],
    as_json: Json = False,
) -> None:
    """Write an FMU 2.0 for co-simulation, for Simulink-like tools: C inside, libraries built here."""
    _export("fmu", model, options, out, as_json)


@command
def ros2(model: Model, options: ExportOptions, out: Folder, as_json: Json = False) -> None:
    """Write a package of ROS 2: a chainable controller of ros2_control around the model's C."""
    _export("ros2", model, options, out, as_json)


@command
def mjcf(
    model: Model,
    options: MJCFOptions,
    out: Annotated[Path, Option("MJCF to write (.xml).", "FILE", "-o")],
    as_json: Json = False,
) -> None:
    """Write a muscle as plain XML for MuJoCo: of a balance fitted with --for mjcf."""
    _export("mjcf", model, options, out, as_json)


def _export(
    target: Literal["c", "fmu", "ros2", "mjcf"],
    model: Path,
    options: ExportOptions | MJCFOptions,
    out: Path,
    as_json: bool,
) -> None:
    from mckibben import workflow
    from mckibben.report import results, text

    exported = workflow.export(model, out, target, options)
    show(exported, lambda: text.lines(results.exported(exported)), as_json, written=[out])


export = click.Group(
    "export", help=__doc__, commands={one.name or "": one for one in (c, fmu, ros2, mjcf)}
)
