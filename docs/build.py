"""Build the documentation, offline: pages made from the code, pictures made by scripts, then Sphinx.

    python docs/build.py            # into docs/_build/html; warnings are errors

Takes about two minutes; pictures of models that have not changed are kept.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import inspect
import re
import runpy
import shutil
import sys
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import mckibben
from mckibben import registry
from mckibben.comparison.limits import limits
from mckibben.errors import MckibbenError

DOCS = Path(__file__).parent
MADE = DOCS / "_generated"
SOURCE = Path(mckibben.__file__).parent

PARTS = (
    *("recording", "signals", "metrics", "characterization", "files", "rigs", "environments"),
    *("blocks", "estimators", "control", "comparison", "papers", "report", "export", "stream"),
)
"""Of the package, in the order of its layers."""


def write(path: Path, text: str) -> None:
    """Write a page, unless it is there as it should be: Sphinx then need not read it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


PROTOCOLS = {
    "multistate": ("isometric-200mm", "isometric-190mm", "isobaric-2bar", "isobaric-4bar"),
    "activation-pressure": ("sine-50N-0.5Hz", "sine-150N-0.5Hz"),
}
"""Runs to fit models of force and of activation pressure to."""

# -- API reference ---------------------------------------------------------------------------


def modules(part: str) -> Iterator[str]:
    """Give the names of the modules of a part that document something public."""
    place = SOURCE / part
    paths = sorted(place.rglob("*.py")) if place.is_dir() else [SOURCE / f"{part}.py"]
    for path in paths:
        names = path.relative_to(SOURCE).with_suffix("").parts
        if names[-1] != "__init__" and not any(name.startswith("_") for name in names):
            yield ".".join(("mckibben", *names))


def write_api() -> None:
    """Write a page a part, which Sphinx fills from the docstrings."""
    for part in PARTS:
        lines = [f"# {part}", ""]
        for module in modules(part):
            lines += [f"## {module}", "", "```{eval-rst}", f".. automodule:: {module}", "```", ""]
        write(MADE / "api" / f"{part}.md", "\n".join(lines))
    listed = "\n".join(PARTS)
    write(
        MADE / "api" / "index.md",
        f"# API reference\n\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n",
    )


# -- a page a model --------------------------------------------------------------------------


def recordings() -> dict[tuple[str, str], list[Any]]:
    """Return short recordings of virtual rigs to fit models to, by what they map."""
    from mckibben.rigs import load_rig, record
    from mckibben.signals import decaying_triangle
    from mckibben.signals.protocol import protocol

    time = np.arange(1200) * 0.05
    pressure = decaying_triangle(time, period=10.0, high=5.0, low=1.0)
    lifted = load_rig("mas20-hanging").run(mckibben.Recording({"pressure": pressure}, 0.05))
    found = {("pressure", "displacement"): [lifted]}
    for name, wanted in PROTOCOLS.items():
        plan = protocol(name)
        rig = load_rig(plan.rig)
        runs = [made for _, made in record(plan, rig, runs=list(wanted), seed=0, jobs=1)]
        if name == "activation-pressure":
            runs = [contracting(one) for one in runs]
            found["contraction", "pressure"] = runs
        else:
            found["length", "force"] = runs
    return found


def contracting(recording: Any) -> Any:
    """Return a recording with the contraction of a muscle of 530 mm."""
    share = recording["displacement"] / 530.0
    return recording.with_channels({"contraction": ""}, contraction=share)


def fitted(name: str, data: dict[tuple[str, str], list[Any]]) -> tuple[Any, list[Any]] | None:
    """Return a model fitted to what it is made for, and the recordings; None where it cannot be."""
    estimator = registry.load("estimators", name)
    for (source, target), runs in data.items():
        if estimator.objection(runs, source, target) is None:
            try:
                return estimator(input=source, output=target).fit(runs).model_, runs
            except MckibbenError:
                continue
    return None


def costs() -> dict[str, list[str]]:
    """Return the rows of the microcontroller's table, by kind of block."""
    text = (DOCS / "deploy" / "microcontroller.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w-]+)` \|(.*)\|$", text, flags=re.M)
    return {kind: [cell.strip() for cell in row.split("|")] for kind, row in rows}


def documented(cls: Any) -> str:
    """Return a class's parameters as a list, from its docstring."""
    text = inspect.getdoc(cls) or ""
    _, mark, rest = text.partition("Parameters\n----------\n")
    if not mark:
        return ""
    section = re.split(r"\n\n?[A-Z]\w+\n-+\n", rest)[0]
    items, lines = [], section.splitlines()
    for line in lines:
        if line and not line.startswith(" "):
            names, _, kind = line.partition(" : ")
            items.append(f"- `{names}`" + (f" ({kind})" if kind else ""))
        elif line.strip() and items:
            joint = " " if "\n" in items[-1] or items[-1].count(": ") else ": "
            items[-1] += joint + line.strip()
    return "\n".join(items)


def leaf_blocks(block: Any) -> list[Any]:
    """Return the blocks that a model is made of."""
    parts = getattr(block, "parts", ())
    return [leaf for part in parts for leaf in leaf_blocks(part)] if parts else [block]


def inverse_of(block: Any) -> str:
    """Return in words whether a model has an inverse."""
    try:
        inverse = block.inverse()
    except MckibbenError as error:
        return f"None: {error}"
    return ", ".join(f"`{leaf.title}`" for leaf in leaf_blocks(inverse)) + "."


def write_models() -> None:
    """Write a page for every model of one muscle, with a picture of it fitted to a virtual rig."""
    names = registry.names("estimators")
    data, cost = recordings(), costs()
    listed = []
    for name in names:
        write_model(name, limits()[name], data, cost)
        summary = inspect.getdoc(registry.load("estimators", name)).splitlines()[0]
        listed.append(f"| [{name}]({name}.md) | {summary} | {limits()[name]['can']} |")
    head = "# Models\n\nOne page each; those of several muscles are in "
    head += "[the API reference](../api/estimators.md).\n\n"
    head += "| model | what it is | what for |\n|---|---|---|\n"
    toc = "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(names) + "\n```\n"
    write(MADE / "models" / "index.md", head + "\n".join(listed) + toc)


def write_model(
    name: str,
    known: Mapping[str, str],
    data: dict[tuple[str, str], list[Any]],
    cost: dict[str, list[str]],
) -> None:
    """Write the page of a model."""
    estimator = registry.load("estimators", name)
    summary = (inspect.getdoc(estimator) or "").splitlines()[0]
    picture = MADE / "models" / f"{name}.png"
    stamp = MADE / "models" / f"{name}.stamp"
    found = fitted(name, data)
    if found is None:
        sys.exit(f"{name} could not be fitted to any recording: mend docs/build.py")
    block, runs = found
    leaves = leaf_blocks(block)
    token = hashlib.sha256(str(block.to_dict()).encode()).hexdigest()
    if not picture.is_file() or not stamp.is_file() or stamp.read_text() != token:
        from mckibben.report.figures import plot_model

        picture.parent.mkdir(parents=True, exist_ok=True)
        plot_model(block, runs[:1], "loops", picture)
        stamp.write_text(token)
    lines = [
        f"# {name}",
        "",
        summary,
        "",
        f"**Can**: {known['can']}",
        "",
        f"**Cannot**: {known['cannot']}",
        "",
    ]
    if "caution" in known:
        lines += [f"**Good only near the motions it was trained on**: {known['caution']}.", ""]
    lines += [f"![{name} fitted to a virtual rig]({name}.png)", ""]
    lines += [
        "*Fitted to a short recording of a virtual rig, running free.*",
        "",
        "## Equations and source",
        "",
    ]
    for kind in dict.fromkeys(leaf.kind for leaf in leaves):
        cls = registry.load("blocks", kind)
        text = (inspect.getdoc(sys.modules[cls.__module__]) or "").strip()
        lines += [
            f"### {kind}",
            "",
            "```text",
            text,
            "```",
            "",
            "Parameters:",
            "",
            documented(cls),
            "",
        ]
        if kind in cost:
            median, most, first, ram, _, flash, _ = cost[kind]
            lines += [
                f"On a Cortex-M4F, single precision, its example: {median} instructions a step, at most "
                f"{most}, the first {first}; {ram} bytes of RAM, {flash} of flash.",
                "",
            ]
    about = inspect.getdoc(sys.modules[estimator.__module__]) or ""
    settings = [
        f"| `{field.name}` | `{field.default!r}` |"
        for field in dataclasses.fields(estimator)
        if field.default is not dataclasses.MISSING
    ]
    lines += [
        "## Identification",
        "",
        "```text",
        about.strip(),
        "```",
        "",
        documented(estimator),
        "",
    ]
    lines += [
        "| setting | default |",
        "|---|---|",
        *settings,
        "",
        "## Inverse",
        "",
        inverse_of(block),
        "",
    ]
    write(MADE / "models" / f"{name}.md", "\n".join(lines))


# -- gallery ---------------------------------------------------------------------------------


def write_gallery() -> None:
    """Run every script of the gallery, and show its picture beside its text."""
    lines = [
        "# Gallery",
        "",
        "Every picture is made by the script below it, from `docs/gallery`.",
        "",
    ]
    scripts = sorted((DOCS / "gallery").glob("*.py"))
    for script in scripts:
        picture = MADE / "gallery" / f"{script.stem}.png"
        picture.parent.mkdir(parents=True, exist_ok=True)
        text = script.read_text(encoding="utf-8")
        stamp = picture.with_suffix(".stamp")
        token = hashlib.sha256(text.encode()).hexdigest()
        if not picture.is_file() or not stamp.is_file() or stamp.read_text() != token:
            kept, sys.argv = sys.argv, [str(script), str(picture)]
            try:
                runpy.run_path(str(script), run_name="__main__")
            finally:
                sys.argv = kept
            stamp.write_text(token)
        title = text.splitlines()[0].strip('"').rstrip(".")
        lines += [
            f"## {title}",
            "",
            f"![{title}](gallery/{picture.name})",
            "",
            "```python",
            text.rstrip(),
            "```",
            "",
        ]
    write(MADE / "gallery.md", "\n".join(lines))


def build() -> int:
    """Run Sphinx over all pages; every warning is an error."""
    from sphinx.cmd.build import build_main

    return build_main(
        ["-W", "--keep-going", "-q", "-b", "html", str(DOCS), str(DOCS / "_build" / "html")]
    )


def main() -> int:
    """Build everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clean", action="store_true", help="forget what earlier builds made")
    if parser.parse_args().clean:
        shutil.rmtree(MADE, ignore_errors=True)
        shutil.rmtree(DOCS / "_build", ignore_errors=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_api()
        write_models()
        write_gallery()
    code = build()
    print(
        f"Built: {DOCS / '_build' / 'html' / 'index.html'}" if code == 0 else "There were warnings."
    )
    return code


if __name__ == "__main__":
    sys.exit(main())
