"""mckibben rig: virtual rigs, for those who have none at hand."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.options import Force, Json, Seed
from mckibben.cli.output import (
    InterruptionError,
    make_folder,
    print_json,
    progress_bar,
    say,
)
from mckibben.errors import DataError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.recording import Recording
    from mckibben.rigs import Rig

app = typer.Typer(
    name="rig",
    help="Virtual rigs: list, show, run, record, new.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)

Name = Annotated[str, typer.Argument(metavar="RIG", help="Name of a rig, or its file (.toml).")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="PARAMETER=VALUE", help="Change the rig: payload=10; repeatable."
    ),
]


@app.command("list")
def list_rigs(as_json: Json = False) -> None:
    """List the rigs, the protocols made for them, and the signals that can drive them."""
    from mckibben import registry
    from mckibben.rigs import load_rig, rig_names
    from mckibben.signals import settings_of
    from mckibben.signals.protocol import protocol

    rigs = {name: load_rig(name) for name in rig_names()}
    protocols = {name: protocol(name) for name in registry.names("protocols")}
    signals = {name: settings_of(name) for name in registry.names("signals")}
    if as_json:
        print_json(
            {
                "rigs": {
                    name: {
                        "title": rig.title,
                        "version": rig.version,
                        "inputs": rig.inputs,
                        "outputs": rig.outputs,
                    }
                    for name, rig in rigs.items()
                },
                "protocols": {
                    name: {"rig": plan.rig, "runs": len(plan.runs), "source": plan.source}
                    for name, plan in protocols.items()
                },
                "signals": {
                    name: {key: kind for key, (kind, _) in settings.items()}
                    for name, settings in signals.items()
                },
            }
        )
        return
    say("Rigs:")
    for name, rig in rigs.items():
        say(f"  {name}: {rig.title}")
        say(f"    driven by {', '.join(rig.inputs)}; measures {', '.join(rig.outputs)}")
    say("\nProtocols:")
    for name, plan in protocols.items():
        say(f"  {name}: {len(plan.runs)} runs on {plan.rig}")
    say("\nSignals (--signal NAME:SETTING=VALUE,...):")
    for name, settings in signals.items():
        say(f"  {name}: {', '.join(_setting(key, *rest) for key, rest in settings.items())}")


def _setting(name: str, kind: str, default: Any) -> str:
    return f"{name} ({kind})" if default is None else f"{name}={default}"


@app.command()
def show(
    name: Name,
    changes: Changes = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write it to (.toml), as your own rig."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Show every parameter of a rig with its unit, meaning and range, as the text of its file.

    With -o it becomes a rig of your own, which is given by its file wherever a rig is asked for.
    """
    from mckibben.outputs import claim, never
    from mckibben.rigs import describe, save_rig

    if out is not None:
        claim(out, never, inputs=[Path(name)], force=force)
    rig = _changed(name, changes)
    if out is not None:
        save_rig(rig.changed({"name": out.stem}), out)
        say(f"Written: {out}")
    elif as_json:
        print_json(rig.model_dump(mode="json"))
    else:
        say(describe(rig), end="")


@app.command()
def run(
    name: Name,
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write: .csv, .tsv, .parquet.")],
    signal: Annotated[
        list[str] | None,
        typer.Option(
            "--signal",
            metavar="[CHANNEL=]SIGNAL[:SETTING=VALUE,...]",
            help="What drives a channel, by default the first; high and low default to the "
            "channel's range. Repeatable. See rig list.",
        ),
    ] = None,
    inputs: Annotated[
        Path | None, typer.Option("--inputs", help="Recording to take the commands from instead.")
    ] = None,
    duration: Annotated[float, typer.Option("--duration", help="Seconds.")] = 60.0,
    rate: Annotated[
        float | None, typer.Option("--rate", help="Samples per second. Default: the rig's.")
    ] = None,
    changes: Changes = None,
    ideal: Annotated[
        bool, typer.Option("--ideal", help="Perfect sensors; adds volume and temperature.")
    ] = False,
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run one experiment and write the recording.

    The rig begins at rest at the first commands, unless its file or --set says where (start.pressure=1).
    """
    from mckibben.files import write
    from mckibben.outputs import claim_recording

    read = [Path(name), *([] if inputs is None else [inputs])]
    claim_recording(out, inputs=read, force=force)
    rig = _changed(name, changes)
    if (signal is None) == (inputs is None):
        raise DataError(
            "a rig is driven by --signal or by --inputs", remedy="give one of them, not both"
        )
    if inputs is not None:
        given = _read_inputs(rig, inputs)
    else:
        given = _made_inputs(rig, signal or [], duration, rate, seed)
    rig = rig.changed(_starts(rig, given))
    recording = rig.run(given, seed, ideal=ideal)
    write(recording.with_meta(name=out.stem), out)
    spans = {
        channel: [float(samples.min()), float(samples.max())]
        for channel, samples in recording.channels.items()
    }
    if as_json:
        print_json(
            {
                "file": str(out),
                "n_samples": len(recording),
                "ranges": spans,
                "saturated": dict(recording.meta.get("saturated", {})),
            }
        )
        return
    for channel, (low, high) in spans.items():
        say(f"{channel}: {numeral(low + 0.0, 4)} to {numeral(high, 4)} {recording.units[channel]}")
    say(f"Written: {out}")


@app.command()
def record(
    protocol: Annotated[str, typer.Argument(help="Protocol to record; see rig list.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write the recordings to.")],
    rig: Annotated[
        str | None, typer.Option("--rig", help="Rig to record on. Default: the protocol's.")
    ] = None,
    changes: Changes = None,
    file_format: Annotated[str, typer.Option("--format", help="csv, tsv or parquet.")] = "csv",
    only: Annotated[
        str | None,
        typer.Option("--only", metavar="TEXT", help="Only runs with TEXT in their name."),
    ] = None,
    seed: Seed = 0,
    jobs: Annotated[int | None, typer.Option("--jobs", help="Runs at a time.")] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Record a paper's whole protocol: one file a run, and protocol.json that says what each is for.

    Files that a run stopped early has left are kept and not made again.
    """
    from mckibben.files import write
    from mckibben.outputs import claim_recording
    from mckibben.rigs import record as record_runs
    from mckibben.signals.protocol import protocol as protocol_named

    if file_format not in ("csv", "tsv", "parquet"):
        raise DataError(
            f"there is no format {file_format!r}", remedy="give csv, tsv or parquet with --format"
        )
    plant = _changed(rig or protocol_named(protocol).rig, changes)
    plan = protocol_named(protocol, plant)
    runs = [run for run in plan.runs if only is None or only in run.name]
    if not runs:
        raise DataError(
            f"no run of {protocol!r} has {only!r} in its name",
            remedy=f"there are {', '.join(run.name for run in plan.runs[:5])}, ...",
        )
    folder = make_folder(out)
    said = _said(plan, plant, seed, file_format)
    kept = _kept(folder, said)
    wanted = [run.name for run in runs if run.name not in kept]
    for name in wanted:
        claim_recording(folder / f"{name}.{file_format}", inputs=[Path(rig or "")], force=force)
    done = 0
    try:
        with progress_bar(f"Recording {protocol}:") as tell:
            for made, recording in record_runs(plan, plant, runs=wanted, seed=seed, jobs=jobs):
                write(recording, folder / f"{made.name}.{file_format}")
                done += 1
                tell(done / len(wanted), made.name)
    except KeyboardInterrupt:
        raise InterruptionError(
            f"Interrupted: {done} of {len(wanted)} recordings are in {folder}; the same command goes on."
        ) from None
    if as_json:
        print_json({"folder": str(folder), "recorded": wanted, "kept": sorted(kept)})
        return
    note = f", {len(kept)} were there already" if kept else ""
    say(f"Written: {len(wanted)} recordings to {folder}{note}; roles are in protocol.json")


@app.command()
def new(
    file: Annotated[Path, typer.Argument(help="File to write (.toml).")],
    diameter: Annotated[float, typer.Option(help="Inner diameter [mm].")],
    length: Annotated[float, typer.Option(help="Length at rest [mm].")],
    max_pressure: Annotated[float, typer.Option(help="Highest pressure [bar].")],
    max_force: Annotated[float, typer.Option(help="Force at rest length and that pressure [N].")],
    max_contraction: Annotated[
        float, typer.Option(help="Contraction at that pressure without load, for instance 0.25.")
    ],
    payload: Annotated[float, typer.Option(help="Mass hanging from it [kg].")] = 0.0,
    loop_width: Annotated[
        float, typer.Option(help="Loop width e_w as a share of its stroke, for instance 0.15.")
    ] = 0.15,
    force: Force = False,
) -> None:
    """Make a rig of your own muscle from the numbers of its data sheet."""
    from mckibben.outputs import claim, never
    from mckibben.rigs import rig_from_data_sheet, save_rig

    claim(file, never, force=force)
    rig = rig_from_data_sheet(
        name="".join(c if c.isalnum() else "-" for c in file.stem.lower()).strip("-") or "my-rig",
        diameter=diameter,
        length=length,
        max_pressure=max_pressure,
        max_force=max_force,
        max_contraction=max_contraction,
        payload=payload,
        loop_width=loop_width,
    )
    save_rig(rig, file)
    say(
        f"Written: {file}; run it with: mckibben rig run {file} --signal triangle:period=10 -o run.csv"
    )


def _changed(name: str, changes: list[str] | None) -> Rig:
    from mckibben.rigs import load_rig

    rig = load_rig(name)
    settings: dict[str, Any] = {}
    for item in changes or []:
        key, equals, text = item.partition("=")
        if not (key and equals and text):
            raise DataError(
                f"--set {item!r} is not of the form PARAMETER=VALUE",
                remedy="write --set payload=10",
            )
        try:
            settings[key.replace("-", "_")] = json.loads(text)
        except (ValueError, RecursionError):
            settings[key.replace("-", "_")] = text
    return rig.changed(settings) if settings else rig


def _made_inputs(
    rig: Rig, signals: list[str], duration: float, rate: float | None, seed: int
) -> Recording:
    import numpy as np

    from mckibben.recording import Recording
    from mckibben.signals import build, settings_of

    rate = 1 / rig.sample_time if rate is None else rate
    if not (0 < duration < 1e6 and 0 < rate <= 1e5 and duration * rate >= 1):
        raise DataError(
            f"{duration:g} s at {rate:g} samples a second cannot be recorded",
            remedy="give --duration up to 1e6 and --rate up to 1e5, and at least two samples",
        )
    time = np.arange(round(duration * rate) + 1) / rate
    channels = {}
    for item in signals:
        head, _, tail = item.partition(":")
        channel, equals, kind = head.rpartition("=")
        channel = channel if equals else rig.inputs[0]
        if channel not in rig.inputs:
            raise DataError(
                f"--signal {item!r}: the rig {rig.name!r} has no input {channel!r}",
                remedy=f"use one of {', '.join(rig.inputs)}",
            )
        settings: dict[str, Any] = {}
        for pair in filter(None, tail.split(",")):
            key, equals, value = pair.partition("=")
            if not (key and equals and value):
                raise DataError(
                    f"--signal {item!r}: {pair!r} is not of the form SETTING=VALUE",
                    remedy="write for instance triangle:period=10,high=5.5",
                )
            settings[key.replace("-", "_")] = value
        known, limits = settings_of(kind), rig.limits(channel)
        defaults: dict[str, Any] = {
            "low": limits.low,
            "high": limits.high,
            "peaks": limits.high,
            "seed": seed,
        }
        settings = {key: defaults[key] for key in known if key in defaults} | settings
        channels[channel] = build(kind, time, **settings)
    return Recording(channels, 1 / rate)


def _starts(rig: Rig, given: Recording) -> dict[str, float]:
    """Return the settings by which a rig rests at the first commands, unless it says where it rests."""
    if rig.start:
        return {}
    limits = {name: rig.limits(name) for name in rig.inputs if name in given}
    return {
        f"start.{name}": min(max(float(given[name][0]), limit.low), limit.high)
        for name, limit in limits.items()
    }


def _read_inputs(rig: Rig, file: Path) -> Recording:
    from mckibben.files import read

    recordings = read(file, channels=[rig.inputs[0]], informative=False)
    if len(recordings) != 1:
        raise DataError("there are several recordings in it", file=file, remedy="give one")
    (recording,) = recordings
    return recording.select([name for name in rig.inputs if name in recording])


def _said(plan: Any, rig: Rig, seed: int, file_format: str) -> dict[str, Any]:
    return {
        "protocol": plan.name,
        "source": plan.source,
        "notes": plan.notes,
        "seed": seed,
        "rig": rig.model_dump(mode="json"),
        "runs": [
            {
                "name": run.name,
                "file": f"{run.name}.{file_format}",
                "role": run.role,
                "labels": dict(run.labels),
                "settings": dict(run.settings),
            }
            for run in plan.runs
        ],
    }


def _kept(folder: Path, said: dict[str, Any]) -> set[str]:
    """Write what the folder is to hold, and return the runs that it holds already."""
    from mckibben.outputs import is_recording
    from mckibben.system import ordinary
    from mckibben.system.atomic import to_json, write_text

    text, place = to_json(said) + "\n", folder / "protocol.json"
    if os.path.lexists(place) and ordinary.read_text(place, most=ordinary.DESCRIPTION) != text:
        raise DataError(
            "the folder holds another protocol, rig or seed",
            file=place,
            remedy="give another folder with -o, or remove this one",
        )
    write_text(place, text)
    return {run["name"] for run in said["runs"] if is_recording(folder / run["file"])}
