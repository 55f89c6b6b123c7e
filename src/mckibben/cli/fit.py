"""mckibben fit: identify one model and save it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mckibben.cli.options import (
    Columns,
    Files,
    Force,
    GapPolicy,
    Gaps,
    Json,
    Rate,
    Reading,
    Resample,
    Seed,
    Settings,
    Units,
    parse_settings,
)
from mckibben.cli.output import figure, print_json, progress_bar, say
from mckibben.errors import DataError, ModelError

if TYPE_CHECKING:
    from mckibben.recording import Recording

STARTS_MATTER = 0.05
"""Relative difference of the errors from rest and from fitted starts that is told."""


def fit(
    model: Annotated[str, typer.Argument(help="Short name; see info --models.")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Model file to write (JSON).")],
    input: Annotated[  # noqa: A002
        str | None, typer.Option("--input", metavar="CHANNEL", help="Input; default the model's.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", metavar="CHANNEL", help="Output; default the model's.")
    ] = None,
    method: Annotated[
        str | None, typer.Option("--method", help="How to search: ls, pso-ls, pso.")
    ] = None,
    settings: Settings = None,
    validation: Annotated[
        list[Path] | None,
        typer.Option(
            "--validation", metavar="FILE", help="Several muscles: stops a search; repeatable."
        ),
    ] = None,
    seed: Seed = 0,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Identify one model from recordings and save it as JSON.

    Models of several muscles (coupled-pi, force-balance, sdchm, sdchm-published, tsfnn) find their
    channels by name: pressure_1 ..., displacement_1 ..., and pressure_extensor where there is one.
    """
    from mckibben import registry
    from mckibben.outputs import claim_model

    claim_model(out, inputs=[*files, *(validation or [])], force=force)
    if model in registry.names("coupled"):
        reading = Reading(column, unit, rate, gaps, resample)
        held_back = reading.read(validation or [], None)
        _fit_coupled(
            model, reading.read(files, None), held_back, out, method, settings, seed, as_json
        )
        return
    if validation:
        raise DataError(
            f"--validation is for models of several muscles, not for {model!r}",
            remedy="leave it out",
        )
    estimator_class = registry.load("estimators", model)
    given = parse_settings(settings, model)
    named = {"input": input, "output": output, "method": method}
    given = {key: value for key, value in named.items() if value is not None} | given
    estimator = estimator_class(**{"seed": seed} | given)
    # of several, each may hold the input, as isometric runs hold the length
    recordings = Reading(column, unit, rate, gaps, resample).read(
        files, [estimator.input, estimator.output], informative=len(files) == 1
    )
    unit_name = recordings[0].units[estimator.output]
    with progress_bar(f"fitting {model}") as tell:
        estimator.fit(
            recordings,
            progress=lambda share, best: tell(share, f"best {figure(best)} {unit_name}"),
        )
    estimator.model_.save(out)
    found = estimator.diagnostics_
    names = estimator.model_.parameter_names
    undetermined = [names[place] for place in estimator.undetermined()]
    if as_json:
        print_json(
            {
                "model": model,
                "file": str(out),
                "n_parameters": estimator.model_.n_parameters,
                "rmse": found.rmse,
                "rmse_from_rest": found.rmse_from_rest,
                "n_samples": found.n_samples,
                "n_evaluations": found.n_evaluations,
                "seconds": found.seconds,
                "interrupted": found.interrupted,
                "condition": found.condition,
                "parameters": estimator.model_.pack().tolist(),
                "standard_errors": list(found.standard_errors),
                "at_bounds": list(found.at_bounds),
                "undetermined": undetermined,
            }
        )
        return
    stopped = " (interrupted: the best until then)" if found.interrupted else ""
    say(
        f"{model}: free-running RMSE {figure(found.rmse, 4)} {unit_name} on {found.n_samples} samples, "
        f"{estimator.model_.n_parameters} parameters, {found.seconds:.2f} s{stopped}"
    )
    if abs(found.rmse_from_rest - found.rmse) > STARTS_MATTER * found.rmse:
        say(
            "That starts every recording from its fitted state; from rest, as streams and generated "
            f"code start, the RMSE is {figure(found.rmse_from_rest, 4)} {unit_name}."
        )
    if undetermined:
        say(f"Not determined by these recordings: {'; '.join(undetermined)}.")
    say(f"Written: {out}")


def _fit_coupled(
    model: str,
    recordings: list[Recording],
    held_back: list[Recording],
    out: Path,
    method: str | None,
    settings: list[str] | None,
    seed: int,
    as_json: bool,
) -> None:
    """Identify a model of several muscles."""
    from mckibben import registry

    estimator_class = registry.load("coupled", model)
    given = {"seed": seed} | parse_settings(settings, model, group="coupled")
    if method is not None:
        given["method"] = method
    try:
        estimator = estimator_class(**given)
    except TypeError:
        raise ModelError(
            f"{model!r} has no setting 'method'. Remedy: leave --method out."
        ) from None
    with progress_bar(f"fitting {model}") as tell:
        estimator.fit(recordings, validation=held_back, progress=tell)
    block, found = estimator.model_, estimator.diagnostics_
    block.save(out)
    names = [channel.name for channel in block.outputs]
    if as_json:
        print_json(
            {
                "model": model,
                "file": str(out),
                "n_parameters": block.n_parameters,
                "rmse": dict(zip(names, found.rmse, strict=True)),
                "n_samples": found.n_samples,
                "seconds": found.seconds,
                "notes": list(found.notes),
            }
        )
        return
    errors = ", ".join(
        f"{name} {figure(value, 4)} mm" for name, value in zip(names, found.rmse, strict=True)
    )
    say(
        f"{model}: free-running RMSE {errors} on {found.n_samples} samples of {len(recordings)} "
        f"recordings, {block.n_parameters} parameters, {found.seconds:.2f} s"
    )
    for note in found.notes:
        say(f"Note: {note}")
    say(f"Written: {out}")
