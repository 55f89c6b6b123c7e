"""mckibben fit: identify one model and save it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import (
    Columns,
    Files,
    GapPolicy,
    Gaps,
    Input,
    Json,
    Output,
    Rate,
    Reading,
    Resample,
    Seed,
    Settings,
    Units,
    parse_settings,
)
from mckibben.cli.output import figure, print_json, progress_bar


def fit(
    model: Annotated[str, typer.Argument(help="Short name; see info --models.")],
    files: Files,
    out: Annotated[Path, typer.Option("-o", "--out", help="Model file to write (JSON).")],
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    method: Annotated[
        str | None, typer.Option("--method", help="How to search: ls, pso-ls, pso.")
    ] = None,
    settings: Settings = None,
    seed: Seed = 0,
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    as_json: Json = False,
) -> None:
    """Identify one model from recordings and save it as JSON."""
    from mckibben import registry

    estimator_class = registry.load("estimators", model)
    given = parse_settings(settings, model)
    recordings = Reading(column, unit, rate, gaps, resample).read(files, [input, output])
    given = {"input": input, "output": output, "seed": seed} | given
    if method is not None:
        given["method"] = method
    estimator = estimator_class(**given)
    unit_name = recordings[0].units[output]
    with progress_bar(f"fitting {model}") as tell:
        estimator.fit(
            recordings,
            progress=lambda share, best: tell(share, f"best {figure(best)} {unit_name}"),
        )
    estimator.model_.save(out)
    found = estimator.diagnostics_
    if as_json:
        print_json(
            {
                "model": model,
                "file": str(out),
                "n_parameters": estimator.model_.n_parameters,
                "rmse": found.rmse,
                "n_samples": found.n_samples,
                "n_evaluations": found.n_evaluations,
                "seconds": found.seconds,
                "interrupted": found.interrupted,
                "condition": found.condition,
                "parameters": estimator.model_.pack().tolist(),
                "standard_errors": list(found.standard_errors),
                "at_bounds": list(found.at_bounds),
            }
        )
        return
    stopped = " (interrupted: the best until then)" if found.interrupted else ""
    print(
        f"{model}: free-running RMSE {figure(found.rmse, 4)} {unit_name} on {found.n_samples} samples, "
        f"{estimator.model_.n_parameters} parameters, {found.seconds:.2f} s{stopped}"
    )
    print(f"Written: {out}")
