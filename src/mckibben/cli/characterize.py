"""mckibben characterize: what a muscle does, in numbers and words."""

from __future__ import annotations

from mckibben.cli.options import (
    Columns,
    Files,
    GapPolicy,
    Gaps,
    Input,
    Json,
    Output,
    Rate,
    Reading,
    Resample,
    Units,
)
from mckibben.cli.output import figure, print_json, print_table, say


def characterize(
    files: Files,
    input: Input = "pressure",  # noqa: A002
    output: Output = "displacement",
    column: Columns = None,
    unit: Units = None,
    rate: Rate = None,
    gaps: GapPolicy = Gaps.ERROR,
    resample: Resample = None,
    as_json: Json = False,
) -> None:
    """Say what the muscle does: loop width, asymmetry, dead zone, creep, rate dependence."""
    recordings = Reading(column, unit, rate, gaps, resample).read(files, [input, output])
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
    return figure(value, 4) if isinstance(value, float) else ("-" if value is None else str(value))
