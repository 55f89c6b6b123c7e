"""A page for every model, from its declarations and a fitted example."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import mckibben
from making.pages import DOCS, MADE, equation, inline, plain, table, toctree, write
from making.settings import settings_table
from mckibben import registry
from mckibben.blocks.equations import quantities, written
from mckibben.blocks.notation import Written, unit_tex
from mckibben.errors import MckibbenError
from mckibben.estimators.catalogue import ability, declared, full_name, needs


def named() -> dict[str, tuple[str, str]]:
    """Return every model's full name, and the title of its group.

    Exits where a model has no example.
    """
    found = {model: (full_name(model), need.title) for need in needs() for model in need.models}
    for model in found:
        if not example(model).is_file():
            sys.exit(f"{model} has no example: run python docs/models/fits.py {model}")
    return found


def example(model: str) -> Path:
    """Return the path of a model's fitted example."""
    return DOCS / "models" / "fitted" / f"{model}.json"


def pictured(model: str) -> Path:
    """Return the path of the figure of a model's loops; examples that are not fitted have none."""
    return DOCS / "pictures" / "models" / f"{model}.png"


def caption(model: str) -> str:
    """Return the caption: the data that the model was fitted to (docs/models/fits.py)."""
    if getattr(declared(model), "made_for", None) == ("force", "displacement"):
        return (
            "A model fitted to a simulation of the Bouc-Wen benchmark with its published parameters "
            "(not a muscle; Noël and Schoukens, 2016)"
        )
    return "A model fitted to short recordings of a virtual rig"


def costs() -> dict[str, list[str]]:
    """Return the rows of the microcontroller's table, by kind of block."""
    text = (DOCS / "deploy" / "microcontroller.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w-]+)` \|(.*)\|$", text, flags=re.M)
    return {kind: [cell.strip() for cell in row.split("|")] for kind, row in rows}


def leaves(block: Any) -> list[Any]:
    """Return the blocks that a model is made of."""
    parts = getattr(block, "parts", ())
    return [leaf for part in parts for leaf in leaves(part)] if parts else [block]


def summary(model: str) -> str:
    """Return a model's description in one sentence."""
    return (inspect.getdoc(registry.load("estimators", model)) or "").splitlines()[0]


def write_models() -> None:
    """Write a page for every model, and an index by full name."""
    cost, names = costs(), named()
    for model, (name, group) in names.items():
        write(
            MADE / "models" / f"{model}.md",
            "\n".join(page(model, name, group, cost)),
        )
    lines = [
        "# Models by name",
        "",
        "The page of each model describes its equations, parameters, settings, inverse, cost and "
        "source. [Which model](../../models/choosing.md) compares the models. "
        "An asterisk marks models that are accurate only near their training data.",
        "",
    ]
    for need in needs():
        lines += [f"## {need.title}", "", need.about, ""]
        rows = []
        for model in need.models:
            star = " \\*" if declared(model).caution else ""
            rows.append(
                [f"[{names[model][0]}]({model}.md){star}", f"`{model}`", plain(ability(model))]
            )
        lines += table(["model", "name in commands", "purpose"], rows)
    lines += ["## Alphabetical list", ""]
    ordered = sorted((name, model) for model, (name, _) in names.items())
    lines += [", ".join(f"[{name}]({model}.md)" for name, model in ordered) + ".", ""]
    write(MADE / "models" / "index.md", "\n".join([*lines, *toctree(list(names), "hidden")]))


def page(model: str, name: str, group: str, cost: Mapping[str, list[str]]) -> list[str]:
    """Return the lines of a model's page."""
    estimator = declared(model)
    block = mckibben.load(example(model))
    lines = [f"# {name}", "", f"```{{index}} !{model}", "```", "", plain(summary(model)), ""]
    lines += table(
        ["", ""],
        [
            ["name in commands", f"`{model}`"],
            ["group", group],
            ["inputs → outputs", mapped(block)],
            [
                "sample times",
                "required" if block.rate_dependent else "not required; the order is sufficient",
            ],
            ["inverse", inverse(block)],
            ["fit time", f"about {estimator.effort:g} s for 10 000 samples"],
            *([["source", "; ".join(sources)]] if (sources := source(block)) else []),
        ],
    )
    lines += [
        f"**Capabilities**: {plain(ability(model))}",
        "",
        f"**Limitations**: {plain(estimator.cannot)}",
        "",
    ]
    if estimator.caution:
        lines += [
            f"**Accurate only near its training data**: {plain(estimator.caution)}.",
            "",
        ]
    if pictured(model).is_file():
        lines += [f"```{{image}} ../../pictures/models/{model}.png", ":class: model-loop"]
        lines += [f":alt: {name}, free-run simulation", "```", ""]
        lines += [f"*{caption(model)}, and its free-run simulation.*", ""]
    lines += [
        "## How to fit it",
        "",
        *fitting(model, estimator, block),
        "## Equations",
        "",
        *paper(written(described(block))),
        "## Parameters",
        "",
        *parameters(described(block)),
        "## Settings",
        "",
        "Use `--set NAME=VALUE` in commands, or an argument in Python.",
        "",
        *settings_table(estimator),
        "## Identification",
        "",
        plain(inspect.getdoc(sys.modules[estimator.__module__]) or ""),
        "",
        "## Description",
        "",
    ]
    for kind in dict.fromkeys(leaf.kind for leaf in leaves(described(block))):
        about = inspect.getdoc(sys.modules[registry.load("blocks", kind).__module__]) or ""
        lines += [f"### {kind}", "", plain(about), ""]
        if kind in cost:
            median, most, first, ram, _, flash, _ = cost[kind]
            lines += [
                f"Cost on a microcontroller (Cortex-M4F, single precision, a small example): "
                f"{median} instructions per step, at most {most}, {first} in the first step; "
                f"{ram} bytes of RAM, {flash} of flash.",
                "",
            ]
    return lines


def mapped(block: Any) -> str:
    """Return the channels of a model, with their units."""

    def listed(channels: Any) -> str:
        return ", ".join(f"{one.name} [{one.unit or '–'}]" for one in channels)

    driven = [one for one in block.inputs if one.name not in block.scheduling]
    scheduling = [one for one in block.inputs if one.name in block.scheduling]
    given = f"; scheduling {listed(scheduling)}" if scheduling else ""
    return f"{listed(driven)}{given} → {listed(block.outputs)}"


def compensates(block: Any) -> bool:
    """Return whether a model's outputs are pressures, so that it is itself a compensator."""
    return all(one.name.startswith("pressure") for one in block.outputs) and not any(
        one.name.startswith("voltage") for one in block.inputs
    )


def described(block: Any) -> Any:
    """Return the block whose equations are shown: for `balance`, those solved for the pressure."""
    return block.forward if block.inverts else block


def inverse(block: Any) -> str:
    """Return a description of a model's inverse."""
    if compensates(block):
        return "the model is itself a compensator"
    if block.inverts:
        return "yes, explicit: the equations are solved for the pressure"
    try:
        found = block.inverse()
    except MckibbenError as error:
        return f"none in this example: {plain(str(error))}"
    made_of = dict.fromkeys(leaf.title for leaf in leaves(found))
    return f"yes: {', '.join(f'`{title}`' for title in made_of)}"


def source(block: Any) -> list[str]:
    """Return the sources named in a model's files, each title once."""
    found = []
    for kind in dict.fromkeys(leaf.kind for leaf in leaves(described(block))):
        text = inspect.getdoc(sys.modules[registry.load("blocks", kind).__module__]) or ""
        found += [
            plain(" ".join(part.split()))
            for part in re.findall(r"Sources?: (.+?)(?:\n\n|\Z)", text, re.S)
        ]
    places: dict[str, list[str]] = {}
    for one in dict.fromkeys(one.rstrip(".") for one in found):
        title, mark, place = one.partition('", ')
        places.setdefault(title + mark, []).append(place)
    return [title + "; ".join(filter(None, each)) for title, each in places.items()]


def fitting(model: str, estimator: Any, block: Any) -> list[str]:
    """Return how a model is fitted, in commands and in Python."""
    lines = ["```bash", f"mckibben fit {model} recording.csv -o model.json"]
    if not compensates(block):
        try:
            block.inverse()
            lines.append("mckibben invert model.json -o inverse.json")
        except MckibbenError:
            pass
    return [
        *lines,
        "```",
        "",
        "```python",
        "import mckibben",
        f"from {estimator.__module__} import {estimator.__name__}",
        "",
        'recordings = mckibben.read("recording.csv")',
        f"estimator = {estimator.__name__}()",
        "model = estimator.fit(recordings).model_",
        'model.save("model.json")',
        "```",
        "",
    ]


def paper(one: Written, level: int = 3) -> list[str]:
    """Return the equations of a model and of its parts, each structure once."""
    lines, seen = [], set()

    def structure(part: Written) -> tuple[Any, ...]:
        return part.equations, *dict.fromkeys(map(structure, part.parts))

    def walk(part: Written, depth: int) -> Iterator[str]:
        if structure(part) in seen:
            return
        seen.add(structure(part))
        if depth and part.equations:
            title = re.sub(r"^\d+\. ", "", part.title.partition(":")[0])
            yield from (f"**{plain(title)}**", "")
        for latex in part.equations:
            yield from equation(latex)
        for inner in part.parts:
            yield from walk(inner, depth + 1)

    lines += list(walk(one, 0))
    return lines or ["See its parts.", ""]


def parameters(block: Any) -> list[str]:
    """Return a table of a model's parameters: symbols, units, and their range in the example."""
    numbered = list(zip(quantities(block), block.pack().tolist(), strict=True))

    def key(item: tuple[Any, float]) -> tuple[str, str, str]:
        one = item[0]
        return re.sub(r"\s*\d+", "", one.name), one.meaning, one.unit

    gathered: dict[tuple[str, str, str], list[tuple[Any, float]]] = {}
    for item in numbered:
        gathered.setdefault(key(item), []).append(item)
    rows = []
    for (name, meaning, unit), items in gathered.items():
        symbols = [items[0][0].symbol, *([items[-1][0].symbol] if len(items) > 1 else [])]
        low, high = float(np.min([v for _, v in items])), float(np.max([v for _, v in items]))
        rows.append(
            [
                inline(r",\ldots,".join(symbols)),
                plain(name),
                plain(meaning),
                inline(unit_tex(unit)) if unit else "–",
                str(len(items)),
                f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}",
            ]
        )
    if not rows:
        return ["None.", ""]
    return [
        f"The example has {len(numbered)} parameters; it is not a real muscle.",
        "",
        *table(["symbol", "name", "meaning", "unit", "number", "value in the example"], rows),
    ]
