"""The report of a re-run: what it asks, printed beside ours first, raw signals last."""

from __future__ import annotations

import re
import sys
from html import unescape

import numpy as np
import pytest

from mckibben import registry
from mckibben.papers.reproduction import Figure, Points, Reproduction, Source, Table
from mckibben.report.reproduction import beside, drawing, reproduction_page

SOURCE = Source("A Muscle", "Does it?", authors="Gaylord", published="Patents, 1958", doi="10.1/x")

TABLE = Table(
    "Errors",
    ("model", "RMSE, printed", "RMSE, here", "why"),
    (("play", 2.0, 1.5, ""), ("creep", None, 0.5, ""), ("none", None, None, "failed")),
    drawn=Points("RMSE [mm]", ("RMSE, printed", "RMSE, here", "not there"), bound=3.0),
)

RAMP = np.linspace(0.0, 1.0, 5)


def page(quick: bool) -> str:
    """Return the report of a re-run of one table and two figures."""
    raw = Figure("Pressure", "time [s]", "pressure [bar]", {"": (RAMP, RAMP)})
    loops = Figure(
        "Loops", "pressure [bar]", "y [mm]", {"virtual": (RAMP, RAMP), "play": (RAMP, RAMP)}
    )
    return reproduction_page(
        Reproduction("muscle", SOURCE, ("It does.",), (TABLE,), (raw, loops), ("Levels.",), quick)
    )


def test_every_number_of_the_drawn_columns_is_a_point_in_its_row() -> None:
    (panel,) = beside(TABLE).panels
    printed, here = panel.curves
    assert panel.categories == ("play", "creep", "none")
    assert (printed.style, printed.x.tolist(), printed.y.tolist()) == ("rings", [2.0], [0.0])
    assert (here.style, here.x.tolist(), here.y.tolist()) == ("dots", [1.5, 0.5], [0.0, 1.0])
    assert [mark.x for mark in panel.marks] == [3.0]


@pytest.mark.parametrize("origin", ["virtual", "measured"])
def test_what_the_muscle_did_is_ink_and_models_are_coloured(origin: str) -> None:
    curves = {origin: (RAMP, RAMP), "play": (RAMP, RAMP)}
    (panel,) = drawing(Figure("Loops", "pressure [bar]", "y [mm]", curves)).panels
    assert [(each.name, each.colour) for each in panel.curves] == [
        (origin, "measured"),
        ("play", "series-1"),
    ]


@pytest.mark.parametrize("quick", [True, False])
def test_the_paper_and_its_question_come_first_and_raw_signals_last(quick: bool) -> None:
    words = page(quick)
    told = ["A Muscle", "Gaylord. Patents, 1958. doi:10.1/x", "Does it?", "It does."]
    places = [words.index(word, words.index("<header>")) for word in told]
    places.append(words.index("Printed beside ours"))
    places += [words.index(f"<h3>{title}</h3>") for title in ("Errors", "Loops", "Pressure")]
    assert places == sorted(places)
    assert ("A quick run" in words) == quick
    assert bool(re.search(r"reproduce muscle --quick", words)) == quick


@pytest.mark.parametrize("paper", registry.names("papers"))
def test_every_paper_says_who_wrote_it_where_and_what_it_asks(paper: str) -> None:
    source = sys.modules[registry.load("papers", paper).__module__].SOURCE
    html = reproduction_page(Reproduction(paper, source, (), (), (), (), quick=True))
    header = unescape(html[html.index("<header>") : html.index("</header>")])
    assert source.title in header
    assert source.question in header
    assert (source.authors or "Authors: not known here") in header
    assert (f"doi:{source.doi}" if source.doi else "DOI: not known here") in header
