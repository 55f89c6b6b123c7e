"""What speaks for and against models that were fitted: what they are tested on, and have to beat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mckibben.app.desk import against, not_recommended
from mckibben.comparison.choosing import USEFUL
from mckibben.report import wording
from mckibben.report.words import CHOICES

RUNS = 2.0
"""The same beyond which an absurd error is the model's own doing."""


def judged(results: Sequence[dict[str, Any]]) -> list[str]:
    """Return what models are tested on and have to beat, and what speaks against them, or tests."""
    said = [_sentence(result["split"]) for result in results if result.get("split")]
    doubted: dict[str, list[str]] = {}
    for result in results:
        constant = result.get("constant") or {}
        tested = wording.number((constant.get("test") or {}).get("rmse"))
        validated = wording.number(constant.get("validation_rmse"))
        if constant:
            heading, _ = CHOICES[result["chosen_by"]]
            said.append(
                f"constant{of_other_data(result)}, the mean of the training output: {heading} "
                f"{validated}, test RMSE {tested}. Every model has to beat it."
            )
        for why in result.get("shared", ()):
            doubted.setdefault(why, []).append(f"{result['name']}{of_other_data(result)}")
    if why_none := not_recommended(results):
        said.append(why_none)
        if (
            share_of_mean(first := next(r for r in results if r["name"] == drawn_first(results)))
            < USEFUL
        ):
            said.append(
                f"On the test, {first['name']} beats the mean. But what a test has chosen, it has not "
                "tested: record more that moves as the test does, and fit again."
            )
    else:
        for name, why in against(results).items():
            doubted.setdefault(f"not recommended: {why}", []).append(name)
    said += [f"{', '.join(names)}: {why}" for why, names in doubted.items()]
    return list(dict.fromkeys(said))


def unvalidated(results: Sequence[dict[str, Any]]) -> str:
    """Return why there is no validated error though the split has parts for it; else nothing."""
    if results[0]["chosen_by"] == "fit" or any(
        result["validation_rmse"] is not None for result in results
    ):
        return ""
    whys = dict.fromkeys(filter(None, (result["validation_failed"] for result in results)))
    why = f" ({'; '.join(whys)})" if whys else ""
    return f"No model was validated, for a fit to a part of the training data failed{why}. "


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def drawn_first(results: Sequence[dict[str, Any]]) -> str:
    """Return the first model, or where none is recommended the first that beats the mean on the test."""
    if not_recommended(results):
        for result in results:
            if result["current"] and share_of_mean(result) < USEFUL:
                return str(result["name"])
    return str(results[0]["name"])


def share_of_mean(result: dict[str, Any]) -> float:
    """Return a model's error on the test over the constant's; infinite where one is not known."""
    tested, least = (
        ((one or {}).get("test") or {}).get("rmse") for one in (result, result["constant"])
    )
    return tested / least if tested is not None and least else float("inf")


def of_other_data(result: dict[str, Any]) -> str:
    """Return a mark on what was fitted to other recordings; else nothing."""
    return "" if result["current"] else " (other data)"
