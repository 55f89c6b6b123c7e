"""The page of the glossary, from the definitions that reports and the workbench show."""

from __future__ import annotations

from making.pages import MADE, plain, table, write
from mckibben.report.glossary import SECTIONS
from mckibben.report.words import QUANTITIES


def write_glossary() -> None:
    """Write the page."""
    lines = ["# Glossary", "", "```{index} !glossary, !terms, !definitions", "```", ""]
    lines += [
        "Units are bar, mm, N, s and rad throughout; files are converted when read and written.",
        "",
    ]
    for title, terms in SECTIONS.items():
        rows = [[plain(term), plain(text)] for term, text in terms.items()]
        lines += [f"## {title}", "", *table(["term", "meaning"], rows)]
    units = {"u": "input unit", "y": "output unit"}
    rows = [
        [
            plain(name.format(input="input", output="output")),
            plain(unit.format(**units)),
            plain(text),
        ]
        for name, _, unit, text in QUANTITIES
    ]
    lines += ["## Characterization", "", "The quantities that `mckibben characterize` prints:", ""]
    lines += table(["quantity", "unit", "meaning"], rows)
    write(MADE / "glossary.md", "\n".join(lines))
