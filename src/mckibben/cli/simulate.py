"""mckibben simulate: run a saved model, or an inverse, over a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import Fields, Force, Json, Reading, loaded
from mckibben.cli.output import print_json, say
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral


@spread
def simulate(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    file: Annotated[Path, typer.Argument(help="Recording with the model's inputs.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write: .csv, .tsv, .parquet.")],
    reading: Reading,
    initial: Annotated[
        str,
        typer.Option(
            help="Memory before the first sample: model (as saved), first_sample, virgin, or measured "
            "(the one excursion that explains the first measured output)."
        ),
    ] = "model",
    horizon: Annotated[
        int | None,
        typer.Option(help="Predict so many samples ahead from measured outputs, instead of free."),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(
            metavar="LEVEL",
            help="Of a calibrated model: also lower and upper ends that hold this share, as 0.9.",
        ),
    ] = None,
    fields: Fields = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a saved model free over a recording; adds channels named OUTPUT_model.

    A linear model whose start is fitted starts from the state that explains the measured output best,
    where the file has it; with --initial first_sample from inputs alone.
    """
    from dataclasses import asdict

    from mckibben.control.identified import beyond_known
    from mckibben.diagnosis.bands import outside
    from mckibben.files import write
    from mckibben.metrics import score
    from mckibben.outputs import claim_recording
    from mckibben.report.words import outside_calibration

    claim_recording(out, inputs=[model, file], force=force)
    banded, block = _parted(loaded(model, fields), interval)
    if banded is not None and horizon is not None:
        raise ModelError("bands are of free runs", remedy="leave --horizon or --interval out")
    wanted = [channel.name for channel in block.inputs]
    whole = list(dict.fromkeys((*wanted, *(channel.name for channel in block.outputs))))
    try:
        recordings = reading.read([file], whole, informative=False)
    except DataError:  # nothing was measured, or what lacks is said of the inputs
        recordings = reading.read([file], wanted, informative=False)
    if len(recordings) > 1:
        raise DataError(
            f"the file splits into {len(recordings)} recordings at its gaps",
            file=file,
            remedy="simulate with --gaps interpolate, or cut the file first",
        )
    (recording,) = recordings
    if horizon is None:
        start = _initial(initial, block, recording)
        modelled = (banded or block).simulate(recording, initial=start)
    else:
        modelled = _predicted(block, recording, horizon)
    notes = beyond_known(block, recording)
    result = recording.select(wanted)
    if banded is not None:
        if initial == "model" and all(c.name in recording for c in block.outputs):
            notes += _started_elsewhere(block, recording)
        band = banded.band
        known = {channel.name: channel for channel in (*band.driving, *band.given)}
        ranges = dict(zip(known, zip(*band.ends, strict=True), strict=True))
        notes += [
            outside_calibration(recording.name, known[name], share, modelled[name], ranges[name])
            for name, share in outside(band, modelled.matrix(known)).items()
        ]
    metrics: dict[str, dict[str, float]] = {}
    for channel in block.outputs:
        name = f"{channel.name}_model"
        result = result.with_channels({name: channel.unit}, **{name: modelled[channel.name]})
        ends = [f"{channel.name}_{end}" for end in ("lower", "upper")] if banded else []
        for end in ends:
            result = result.with_channels({end: channel.unit}, **{end: modelled[end]})
        if channel.name in recording and channel.name not in wanted:
            measured = recording[channel.name]
            result = result.with_channels(
                {channel.name: recording.units[channel.name]}, **{channel.name: measured}
            )
            metrics[channel.name] = asdict(score(measured, modelled[channel.name]))
            if ends:
                lower, upper = (modelled[end] for end in ends)
                inside = (lower <= measured) & (measured <= upper)
                metrics[channel.name] |= {
                    "coverage": float(inside.mean()),
                    "band_width": float((upper - lower).mean()),
                }
    write(result.with_meta(model=str(model)), out)
    if as_json:
        head = {
            "file": str(out),
            "n_samples": len(result),
            "horizon": horizon,
            "interval": interval,
        }
        print_json(head | {"metrics": metrics, "notes": notes})
        return
    for name, figures in metrics.items():
        say(
            f"{name}{'' if horizon is None else f', {horizon} samples ahead'}: "
            f"RMSE {numeral(figures['rmse'], 4)}, MAE {numeral(figures['mae'], 4)}, worst "
            f"{numeral(figures['max_error'], 4)} {recording.units[name]}, R² {numeral(figures['r2'], 5)}"
        )
        if interval is not None:
            say(
                f"{name}: {numeral(100 * figures['coverage'], 3)} % of the samples lie in the band for "
                f"{numeral(100 * interval, 3)} %, {numeral(figures['band_width'], 3)} "
                f"{recording.units[name]} wide on average"
            )
    for note in notes:
        say(f"Note: {note}")
    say(f"Written: {out}")


def _started_elsewhere(block: Any, recording: Any) -> list[str]:
    """Return that a run does not begin as the model does, while its band knows how it begins."""
    import numpy as np

    from mckibben.blocks.free_run import measured_start

    names = [channel.name for channel in block.outputs]
    own = block.initial_state(recording.matrix(c.name for c in block.inputs)[0])
    if np.array_equal(measured_start(block, recording, names), own):
        return []
    return [
        "the run does not begin as the model does by itself; the band is for --initial measured, which "
        "starts it as explains what was measured first"
    ]


def _parted(block: Any, interval: float | None) -> tuple[Any, Any]:
    """Return the model with its band, if one is asked for, and the model."""
    from mckibben.blocks.bands import Banded

    if interval is None:
        return None, block.forward if isinstance(block, Banded) else block
    if not isinstance(block, Banded):
        raise ModelError(
            "this model has no band",
            remedy="calibrate it on recordings that it was not fitted to: mckibben "
            "calibrate model.json FILES -o banded.json",
        )
    return block.at(interval), block.forward


def _predicted(block: Any, recording: Any, horizon: int) -> Any:
    from mckibben.blocks.dynamics.transfer_function import TransferFunction

    if not isinstance(block, TransferFunction):
        raise ModelError(
            f"{block.kind!r} has no noise model, so it cannot predict from measured outputs",
            remedy="leave --horizon out, or fit arx, armax, oe or bj",
        )
    return block.predict(recording, horizon)


def _initial(rule: str, block: Any, recording: Any) -> Any:
    if rule == "model":
        return None
    if rule == "measured":
        from mckibben.blocks.free_run import measured_start

        name = block.outputs[0].name
        recording[name]
        return measured_start(block, recording, name).tolist()
    return rule
