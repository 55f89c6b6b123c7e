"""A call of every command that works, for what holds of all commands."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from mckibben import GPI, PI, Recording, write
from mckibben.cli.main import app
from mckibben.rigs import describe, load_rig
from mckibben.signals import triangle
from tests.export.muscle import MUSCLE

MODEL, RUN, INVERSE, RIG = "model.json", "run.csv", "inverse.json", "rail.toml"


@dataclass(frozen=True)
class Call:
    """A call that works in a folder with `files`.

    Parameters
    ----------
    words : tuple of str
        The last one is what it writes, if it writes anything.
    reads : tuple of str
        Files among them that it reads.
    own : str
        A file that it writes into its folder, where it writes a folder.
    """

    words: tuple[str, ...]
    reads: tuple[str, ...] = ()
    own: str = ""


def call_of(text: str, *reads: str, own: str = "") -> Call:
    return Call(tuple(text.split()), reads, own)


CALLS: dict[str, Call] = {
    "study": call_of(f"{RUN} --test two.csv --models pi --jobs 1 -o out", own="report.html"),
    "characterize": call_of(RUN),
    "fit": call_of(f"pi {RUN} -o out.json", RUN),
    "compare": call_of(f"{RUN} --test two.csv --models pi --jobs 1 -o out", own="leaderboard.csv"),
    "measured": call_of("sets --models pi --jobs 1 -o out", own="measured.md"),
    "simulate": call_of(f"{MODEL} {RUN} -o out.csv", MODEL, RUN),
    "check": call_of(f"{MODEL} {RUN} -o out", own="report.html"),
    "calibrate": call_of(f"{MODEL} {RUN} two.csv -o out.json", MODEL, RUN),
    "invert": call_of(f"{MODEL} --predictive -o out.json", MODEL),
    "track": call_of(f"{INVERSE} --rig {RIG} --reference {RUN} -o out.csv", INVERSE, RUN, RIG),
    "learn": call_of(f"{INVERSE} loop.csv -o out.json", INVERSE, "loop.csv"),
    "review": call_of("loop.csv --compensator inverse.json --no-refit"),
    "plan": call_of(f"{RUN} --minutes 0.5 -o out.csv", RUN),
    "plot": call_of(f"{RUN} --model {MODEL} -o out.png", RUN, MODEL),
    "reproduce": call_of("multistate --quick --jobs 1"),
    "info": call_of(RUN),
    "muscles list": call_of(""),
    "muscles show": call_of("rail"),
    "app": call_of("workspace --no-show"),
    "link": call_of("absent-port"),
    "example": call_of("out", own="decaying-triangle.csv"),
    "export c": call_of(f"{MODEL} -o out", MODEL, own="README.md"),
    "export fmu": call_of(f"{MODEL} --no-library -o out.fmu", MODEL),
    "export mjcf": call_of("muscle.json --rest-length 200 -o out.xml", "muscle.json"),
    "export ros2": call_of(f"{INVERSE} -o out", INVERSE, own="README.md"),
    "rig list": call_of(""),
    "rig show": call_of("rail"),
    "rig run": call_of(f"{RIG} --signal constant:value=1 --duration 1 -o out.csv", RIG),
    "rig record": call_of("field-models --jobs 1 -o out", own="decaying-triangle.csv"),
}


def files(folder: Path) -> None:
    """Write one file of every kind."""
    for name, peaks in ((RUN, [5.0, 4.0]), ("two.csv", [4.5, 3.5])):
        u = triangle(np.arange(0, 8, 0.02), 4.0, peaks)
        y = GPI.example().simulate(u)
        channels = {"pressure": u, "displacement": y, "voltage": u / 10, "force": 20 + u}
        write(Recording(channels, 0.02), folder / name)
    loop, units = (
        {"reference_displacement": y, "displacement": y + 0.1},
        {"reference_displacement": "mm"},
    )
    write(Recording(loop, 0.02, units), folder / "loop.csv")
    (folder / "sets").mkdir()
    shutil.copy(folder / RUN, folder / "sets")
    GPI.example().save(folder / MODEL)
    PI.example().save(folder / "pi.json")
    GPI.example().inverse().save(folder / INVERSE)
    MUSCLE.save(folder / "muscle.json")
    (folder / RIG).write_text(describe(load_rig("mas20-hanging")))


def commands(group: Any = app, path: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Yield every command of the command line by the words that call it."""
    for name in group.list_commands(click.Context(group)):
        found = group.get_command(click.Context(group), name)
        if isinstance(found, click.Group):
            yield from commands(found, (*path, name))
        else:
            yield " ".join((*path, name)), found
