"""mckibben characterize: what a muscle does, in numbers and words."""

from __future__ import annotations

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


@spread
def characterize(
    files: Files,
    reading: Reading,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    as_json: Json = False,
) -> None:
    """Say what the muscle does: loop width, asymmetry, dead zone, creep, rate dependence."""
    recordings = reading.read(files, [input, output])
    from mckibben.characterization import characterize as find
    from mckibben.recording import notes_by_file, reading_notes

    found = find(recordings, input, output)
    if as_json:
        print_json(found.to_dict() | {"notes": notes_by_file(recordings)})
        return
    for sentence in found.sentences:
        say(sentence)
    say()
    print_table(
        ["quantity", "value", "unit"],
        [[str(name), _shown(value), str(units)] for name, value, units, _ in found.table()],
    )
    for note in reading_notes(recordings):
        say(f"Note: {note}")


def _shown(value: object) -> str:
    return numeral(value, 4) if isinstance(value, float) else ("-" if value is None else str(value))
