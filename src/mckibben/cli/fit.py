"""mckibben fit: identify one model and save it."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import (
    Files,
    Force,
    Json,
    Reading,
    Seed,
    Settings,
)
from mckibben.cli.output import print_json, print_table, progress_bar, say
from mckibben.errors import DataError, ModelError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.recording import Recording

STARTS_MATTER = 0.05
"""Relative difference of the errors from rest and from fitted starts that is told."""


@spread
def fit(
    model: Annotated[str, typer.Argument(help="Short name; see info --models.")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Model file to write (JSON).")],
    reading: Reading,
    input: Annotated[  # noqa: A002
        list[str] | None,
        typer.Option("--input", metavar="CHANNEL", help="Input; repeatable; default the model's."),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output", metavar="CHANNEL", help="Output; repeatable; default the model's."
        ),
    ] = None,
    prior: Annotated[
        str | None,
        typer.Option(
            "--prior",
            metavar="NAME|FILE",
            help="What is likely before: a muscle (muscles list), or a data sheet (.toml).",
        ),
    ] = None,
    residual_of: Annotated[
        Path | None,
        typer.Option(
            "--residual-of",
            metavar="MODEL",
            help="Saved model (JSON) whose output is subtracted first; both are written, as their sum.",
        ),
    ] = None,
    settings: Settings = None,
    validation: Annotated[
        list[Path] | None,
        typer.Option("--validation", metavar="FILE", help="Stops a search; repeatable."),
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify one model from recordings and save it as JSON.

    Models of several muscles (balance, coupled-memory, coupled-pi, sdchm, tsfnn) find their
    channels by name: pressure_1 ..., displacement_1 ..., and pressure_extensor where there is one.
    """
    from mckibben import registry
    from mckibben.blocks.compose import Parallel
    from mckibben.blocks.equations import quantities
    from mckibben.blocks.saving import load
    from mckibben.comparison.shared_rows import check_shared
    from mckibben.estimators.catalogue import settings_of
    from mckibben.outputs import claim_model

    estimator_class = registry.load("estimators", model)
    given = settings_of(model, settings or [])
    before = prior or given.get("prior")
    sheets = [Path(before)] if isinstance(before, str) else []
    first = [] if residual_of is None else [residual_of]
    claim_model(out, inputs=[*files, *(validation or []), *sheets, *first], force=force)
    named = {"input": _one(input), "output": _one(output), "prior": prior}
    given = {key: value for key, value in named.items() if value is not None} | given
    known = {field.name for field in fields(estimator_class)}
    if "prior" in given and "prior" not in known:
        raise ModelError(f"{model!r} has no setting 'prior'", remedy="leave --prior out")
    estimator = estimator_class(**{"seed": seed} | given)
    if validation and not estimator.stops_early:
        raise DataError(f"{model!r} does not stop early", remedy="leave --validation out")
    channels = [estimator.input, estimator.output]
    several = not all(isinstance(name, str) for name in channels)
    if channels == ["pressure", "displacement"]:
        asked = (given.get("input"), given.get("output"))
        recordings, estimator.input, estimator.output = reading.read_one(files, *asked)
    else:  # of several, each may hold the input, as isometric runs hold the length
        asked_for = [
            name for some in channels for name in ((some,) if isinstance(some, str) else some or ())
        ]
        informative = not several and len(files) == 1
        recordings = reading.read(files, asked_for or None, informative=informative)
    held_back = reading.read(validation or [], None, informative=False)
    base = None if residual_of is None else load(residual_of)
    if base is not None:
        recordings, held_back = (
            _residuals(base, estimator, some) for some in (recordings, held_back)
        )
    data = estimator.data(recordings)
    names = [[channel.name for channel in some] for some in (data.inputs, data.outputs)]
    check_shared({"fit": recordings}, *names)
    with progress_bar(f"fitting {model}") as tell:
        estimator.fit(
            recordings,
            validation=held_back,
            progress=lambda share, best: tell(
                share, f"best {numeral(best)}" if math.isfinite(best) else ""
            ),
        )
    (estimator.model_ if base is None else Parallel((base, estimator.model_))).save(out)
    found = estimator.diagnostics_
    outputs = estimator.model_.outputs
    unit_name = outputs[0].unit
    by_output = {c.name: e for c, e in zip(outputs, found.rmse_by_output, strict=True)}
    numbers = quantities(estimator.model_)
    notes = [*found.notes, *_unasked(input, estimator.model_, recordings[0])]
    undetermined = [numbers[place].name for place in estimator.undetermined()]
    if as_json:
        print_json(
            {
                "model": model,
                "file": str(out),
                "n_parameters": found.n_free,
                "rmse": found.rmse,
                "rmse_by_output": by_output,
                "rmse_from_rest": found.rmse_from_rest,
                "n_samples": found.n_samples,
                "n_evaluations": found.n_evaluations,
                "seconds": found.seconds,
                "interrupted": found.interrupted,
                "condition": found.condition,
                "parameters": estimator.model_.pack().tolist(),
                "parameter_names": [one.name for one in numbers],
                "parameter_units": [one.unit for one in numbers],
                "standard_errors": list(found.standard_errors),
                "at_bounds": list(found.at_bounds),
                "undetermined": undetermined,
                "notes": notes,
            }
        )
        return
    stopped = " (interrupted: the best until then)" if found.interrupted else ""
    say(
        f"{model}: free-running RMSE {numeral(found.rmse, 4)} {unit_name} on {found.n_samples} samples, "
        f"{found.n_free} parameters, {found.seconds:.2f} s{stopped}"
    )
    if len(by_output) > 1:
        errors = [f"{name} {numeral(value, 4)} {unit_name}" for name, value in by_output.items()]
        say(f"That is the mean of {', '.join(errors)}.")
    if abs(found.rmse_from_rest - found.rmse) > STARTS_MATTER * found.rmse:
        say(
            "That starts every recording from its fitted state; from rest, as streams and generated "
            f"code start, the RMSE is {numeral(found.rmse_from_rest, 4)} {unit_name}."
        )
    if estimator.errors_known:
        print_table(
            ("parameter", "value", "standard error", "unit"),
            [
                (
                    one.name,
                    numeral(value, 4),
                    "–" if math.isnan(error) else numeral(error, 2),
                    one.unit,
                )
                for one, value, error in zip(
                    numbers, estimator.model_.pack(), found.standard_errors, strict=True
                )
            ],
        )
    if undetermined:
        say(f"Not determined by these recordings: {'; '.join(undetermined)}.")
    for note in notes:
        say(f"Note: {note}")
    say(f"Written: {out}{'' if base is None else f', the sum of {residual_of} and this model'}")


def _residuals(base: Block, estimator: Any, recordings: list[Recording]) -> list[Recording]:
    """Return recordings with the output less what a model gives."""
    from mckibben.estimators.force.multistate import extract_hysteresis

    names = [channel.name for channel in base.outputs]
    if names != [estimator.output]:
        raise ModelError(
            f"the model of --residual-of gives {', '.join(names)}, and {estimator.output} "
            "is fitted",
            remedy="name a model of the same output, or the output with --output",
        )
    return extract_hysteresis(recordings, base, output=estimator.output)


def _unasked(given: list[str] | None, model: Block, recording: Recording) -> list[str]:
    """Return that the pressure was taken as input where the command was recorded too, if so."""
    driven = [channel.name for channel in model.inputs]
    if given or "pressure" not in driven or "voltage" in driven or "voltage" not in recording:
        return []
    return [
        "the input is pressure, and voltage was recorded too. Remedy: for a model that commands the "
        "valve, say --input voltage"
    ]


def _one(names: list[str] | None) -> str | tuple[str, ...] | None:
    """Return one name as such, several as a tuple."""
    if names is None:
        return None
    return names[0] if len(names) == 1 else tuple(names)
