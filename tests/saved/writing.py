"""Files of models as a version of the package writes them, with what the models give.

    python -m tests.saved.writing NAME

writes ``tests/saved/NAME.json`` anew; a file is never written again once a later version exists, for
its purpose is to be read by later ones.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from mckibben import Block
from mckibben.blocks.laws.trial import Trial
from mckibben.errors import ModelError
from mckibben.registry import load, names
from mckibben.system.atomic import write_text

SAMPLE_TIME = 0.01
SAMPLES = 25


def models() -> dict[str, Block]:
    """Return an example of every kind, every published model, and the inverse of each that has one."""
    found = {kind: load("blocks", kind).example() for kind in names("blocks")}
    found |= {f"published {name}": load("published", name)() for name in names("published")}
    for name, block in list(found.items()):
        try:
            found[f"inverse of {name}"] = block.inverse()
        except ModelError:
            continue
    return found


def described(block: Block) -> dict[str, object]:
    """Return a model as saved, with inputs and what it gives for them."""
    trial = Trial.of(block, SAMPLE_TIME, 0)
    places = np.linspace(0, len(trial.inputs) - 1, SAMPLES).round().astype(int)
    inputs = trial.inputs[places]
    outputs = block.simulate(inputs, sample_time=SAMPLE_TIME)
    return {"model": block.to_dict(), "inputs": inputs.tolist(), "outputs": outputs.tolist()}


if __name__ == "__main__":
    lines = [
        f"{json.dumps(name)}: {json.dumps(described(block), allow_nan=False)}"
        for name, block in models().items()
    ]
    path = Path(__file__).parent / f"{sys.argv[1]}.json"
    write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")
