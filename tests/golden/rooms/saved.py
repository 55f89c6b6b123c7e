"""Files of models as versions of the package wrote them: they load, simulate and invert.

    python -m tests.golden.rooms.saved NAME

writes ``tests/golden/saved/NAME.json``: every model that no file there holds as this version writes it.
A file is never written again once a later version exists, for its purpose is to be read by later ones.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Block, ModelError, load
from tests.golden.case import Case, Tree
from tests.golden.models import all_models, inputs_of
from tests.golden.running import (
    Array,
    inverted,
    same,
    scheduling_of,
    simulated,
    streamed,
)

FOLDER = Path(__file__).parents[1] / "saved"

N_SAMPLES, EVERY = 25, 5

TOLERANCE = 1e-9
"""How far a loaded model's numbers may be from those that it gave when it was saved."""


def contents(path: Path) -> dict[str, Any]:
    """Return what a file holds: name of a model -> as saved, with inputs and what it gave for them."""
    return dict(json.loads(path.read_text(encoding="utf-8")))


def of_file(stem: str) -> dict[str, tuple[Block, Array, Array]]:
    """Return what loads by name, with inputs and outputs as they were, shape (n, channels)."""
    found: dict[str, tuple[Block, Array, Array]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        for name, content in contents(FOLDER / f"{stem}.json").items():
            path.write_text(json.dumps(content["model"]), encoding="utf-8")
            try:
                block = load(path)
            except ModelError:
                continue
            inputs = np.array(content["inputs"], dtype=float).reshape(-1, len(block.inputs))
            outputs = np.array(content["outputs"], dtype=float).reshape(-1, len(block.outputs))
            found[name] = (block, inputs, outputs)
    return found


def answers(stem: str, folder: Path) -> Tree:
    """Return what the models of a file answer today, or that they are refused."""
    del folder
    found: dict[str, Tree] = dict.fromkeys(contents(FOLDER / f"{stem}.json"), "refused")
    for name, (block, inputs, outputs) in of_file(stem).items():
        again = simulated(block, inputs)
        given = np.column_stack([outputs, scheduling_of(block, inputs)])
        found[name] = {
            "gives what it gave": bool(
                np.allclose(again, outputs, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
            ),
            "stream is batch": same(streamed(block, inputs), again),
            "inverse": inverted(block, given, EVERY),
        }
    return found


def cases() -> Iterator[Case]:
    """Yield a case for every file."""
    for path in sorted(FOLDER.glob("*.json")):
        yield Case(
            f"saved/{path.stem}",
            f"load, simulate, stream and invert all models of tests/golden/saved/{path.name}",
            partial(answers, path.stem),
            {"*": TOLERANCE},
        )


def write(name: str) -> None:
    """Write a file of the models that no other holds as they are written today."""
    path = FOLDER / f"{name}.json"
    if path.exists():
        sys.exit(f"{path.name} is there, and is never written again: give another name")
    known = [saved["model"] for path in FOLDER.glob("*.json") for saved in contents(path).values()]
    lines = []
    for title, model in all_models().items():
        if model.to_dict() in known:
            continue
        inputs = inputs_of(title, model)
        inputs = inputs[np.isfinite(inputs).all(axis=1)]
        inputs = inputs[np.linspace(0, len(inputs) - 1, N_SAMPLES).astype(int)]
        outputs = simulated(model, inputs)
        saved = {"model": model.to_dict(), "inputs": inputs.tolist(), "outputs": outputs.tolist()}
        lines.append(f"{json.dumps(title)}: {json.dumps(saved, allow_nan=False)}")
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("python -m tests.golden.rooms.saved VERSION")
    write(sys.argv[1])
