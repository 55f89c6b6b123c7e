"""What to type to repeat a study, and to use what it found."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mckibben import registry

if TYPE_CHECKING:
    from mckibben.recording import Recording
    from mckibben.studying.study import Study

MINUTES = 3
"""Of the plan that is proposed."""


@dataclass(frozen=True)
class Typed:
    """How a study was asked for on the command line.

    Parameters
    ----------
    study : sequence of str
        All that stood behind ``mckibben``; empty of a study from Python.
    reading : sequence of str
        Of that, the options by which files were read.
    """

    study: Sequence[str] = ()
    reading: Sequence[str] = ()


def commands(study: Study, typed: Typed | None = None) -> list[tuple[str, str]]:
    """Return commands, each after what it does."""
    typed = Typed() if typed is None else typed
    board = study.leaderboard
    train = _files(study.train)
    named = [("--input", name) for name in board.inputs]
    named += [("--output", name) for name in board.outputs]
    channels = [word for pair in named for word in pair]
    seed = ["--seed", str(board.seed)]
    known = registry.names("estimators")
    again = typed.study or [
        *("study", *train),
        *(word for file in _files(study.test) if file not in train for word in ("--test", file)),
        *channels,
        *([] if study.load is None else ["--load", study.load]),
        *(
            "--models",
            ",".join(sorted({*(row.model for row in board.rows), *board.pending} & {*known})),
        ),
        *(*seed, "-o", "study"),
    ]
    lines = [("Repeat this study", again)]
    best = board.best
    if best is not None and best.model in known:
        saved = f"{best.model}.json"
        lines += [
            (
                f"Fit {best.model} to whole recordings",
                ["fit", best.model, *train, *typed.reading, *channels, *seed, "-o", saved],
            ),
            (
                f"Plan {MINUTES} minutes to record next",
                ["plan", *train, *typed.reading, "--minutes", str(MINUTES), "-o", "next.csv"],
            ),
            (
                f"Run it on another {board.input}",
                ["simulate", saved, "new.csv", "-o", "modelled.csv"],
            ),
        ]
    if study.inverse is not None:
        lines.append(
            (
                f"From a desired {board.output} to {board.input}",
                ["simulate", "inverse.json", "reference.csv", "-o", "feedforward.csv"],
            )
        )
    if best is not None and best.banded is not None and best.band is not None:
        level = f"{best.band.level:.12g}"
        lines.append(
            (
                f"{board.output} with the ends of its band, on another {board.input}",
                ["simulate", "banded.json", "new.csv", "--interval", level, "-o", "modelled.csv"],
            )
        )
    return [(what, f"mckibben {shlex.join(words)}") for what, words in lines]


def _files(recordings: Sequence[Recording]) -> list[str]:
    sources = [recording.source or f"{recording.name}.csv" for recording in recordings]
    return list(dict.fromkeys(sources))
