"""mckibben characterize: what a muscle does, in numbers and words."""

from __future__ import annotations

from typing import Annotated

import typer

from mckibben.cli.grouping import spread
from mckibben.cli.options import (
    Files,
    Input,
    Json,
    Output,
    Reading,
)
from mckibben.cli.output import print_json, print_table, say
from mckibben.numerals import numeral

Beside = Annotated[
    list[str] | None,
    typer.Option(
        "--beside", metavar="CHANNEL", help="Another input: look where it rests; repeatable."
    ),
]


@spread
def characterize(
    files: Files,
    reading: Reading,
    input: Input = None,  # noqa: A002
    output: Output = None,
    beside: Beside = None,
    as_json: Json = False,
) -> None:
    """Say what the muscle does: loop width, asymmetry, dead zone, creep, rate dependence."""
    others = beside or []
    recordings, given, moved = reading.read_one(files, input, output, others)
    from mckibben.diagnosis.characterization import characterize as find
    from mckibben.recording import notes_by_file, reading_notes
    from mckibben.report import words

    found = find(recordings, given, moved, beside=others)
    if as_json:
        print_json(found.to_dict() | {"notes": notes_by_file(recordings)})
        return
    for sentence in words.characterization_sentences(found):
        say(sentence)
    say()
    print_table(
        ["quantity", "value", "95 % interval", "unit"],
        [
            [name, _shown(value), " to ".join(map(_shown, limits or ())), unit]
            for name, value, limits, unit, _ in words.characterization_rows(found)
            if value is not None
        ],
    )
    for note in reading_notes(recordings):
        say(f"Note: {note}")


def _shown(value: object) -> str:
    return numeral(value, 4) if isinstance(value, float) else ("-" if value is None else str(value))
