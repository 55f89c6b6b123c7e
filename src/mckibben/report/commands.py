"""Commands that repeat a study and use its results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mckibben import printing, registry

if TYPE_CHECKING:
    from mckibben.recording import Recording
    from mckibben.studying.study import Study


def commands(study: Study, command: str = "") -> list[tuple[str, str]]:
    """Return commands with descriptions; those after the first run in the folder of results.

    Parameters
    ----------
    study : Study
    command : str
        By which it was asked for; default one that is made from the study.
    """
    board, lines = study.leaderboard, []
    if not command:
        options = [word for name in board.inputs for word in ("--input", name)]
        options += [word for name in board.outputs for word in ("--output", name)]
        train = _files(study.train)
        tests = [
            word for file in _files(study.test) if file not in train for word in ("--test", file)
        ]
        models = {*(row.model for row in board.rows), *board.pending} & {
            *registry.names("estimators")
        }
        load = [] if study.load is None else ["--load", study.load]
        words = ["study", *train, *tests, *options, *load, "--models", ",".join(sorted(models))]
        command = printing.command(["mckibben", *words, "--seed", str(board.seed)])
    lines.append(("Repeat this study", command))
    best = board.best
    if best is not None and best.block is not None:
        saved = model_file(best.model)
        run = f"mckibben simulate {saved} new.csv -o modelled.csv"
        lines.append((f"Run {best.model} on another {board.input}", run))
    if best is not None and best.banded is not None and best.band is not None:
        run = f"mckibben simulate banded.json new.csv --interval {best.band.level:.12g} -o band.csv"
        lines.append((f"{board.output} with its band", run))
    if study.inverse is not None:
        run = "mckibben simulate inverse.json reference.csv -o feedforward.csv"
        lines.append((f"{board.input} from a desired {board.output}", run))
        lines.append(("The inverse as C99", "mckibben export c inverse.json -o code"))
    return lines


def _files(recordings: Sequence[Recording]) -> list[str]:
    sources = [recording.source or f"{recording.name}.csv" for recording in recordings]
    return list(dict.fromkeys(f"./{file}" if file.startswith("-") else file for file in sources))


def model_file(model: str) -> str:
    """Return the path of a saved model in the folder.

    >>> model_file("memory a load")
    'models/memory-a-load.json'
    """
    return f"models/{''.join(c if c.isalnum() or c in '-.' else '-' for c in model)}.json"
