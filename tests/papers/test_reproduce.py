"""Re-runs of papers: on small data, through Python and through the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import registry
from mckibben.errors import ModelError
from mckibben.papers import reproduce
from tests.cli.conftest import Cli, files  # noqa: F401  # a fixture
from tests.cli.conftest import cli as cli  # a fixture


def number(found: dict[str, Any], pattern: str) -> float:
    text = " ".join(found["summary"])
    match = re.search(pattern, text)
    assert match, text
    return float(match.group(1))


def test_friction_beats_the_static_law_on_loops_not_used() -> None:
    shares: list[float] = []
    found = reproduce("multistate-friction", quick=True, progress=lambda s, _: shares.append(s))
    assert number(found.to_dict(), r"r² (0\.\d+) on the extracted") >= 0.995
    assert number(found.to_dict(), r"at most ([\d.]+) times") <= 0.5
    assert shares == sorted(shares)
    assert all(
        np.isfinite(curve).all()
        for figure in found.figures
        for pair in figure.curves.values()
        for curve in pair
    )


def test_activation_pressure_needs_no_frequency(cli: Cli, tmp_path: Path) -> None:
    result = cli("reproduce", "activation-pressure", "--quick", "-o", tmp_path / "run", "--json")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    assert number(found, r"frequency: at most ([\d.]+) %") < 5.0
    assert json.loads((tmp_path / "run" / "tables.json").read_text()) == found
    page = (tmp_path / "run" / "report.html").read_text()
    assert not re.search(r"""<(?:script|link|img)[^>]+(?:src|href)=["']?http""", page)
    for table in found["tables"]:
        assert table["title"].partition("(")[0].strip() in page


def test_own_recordings_take_the_place_of_the_rig(
    cli: Cli,
    files: tuple[Path, Path],  # noqa: F811
) -> None:
    train, test = files
    given = ["--train", train, "--test", test]
    result = cli("reproduce", "field-models", "--quick", *given, "--json")
    assert result.code == 0, result.err
    models = {row["model"] for table in json.loads(result.out)["tables"] for row in table["rows"]}
    assert {"cpi", "pi"} <= models


def test_list_names_every_paper(cli: Cli) -> None:
    listed = json.loads(cli("reproduce", "--list", "--json").out)
    assert sorted(listed) == sorted(registry.names("papers"))
    assert all(listed.values())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nobody"], "no paper named 'nobody'"),
        ([], "no paper"),
        (["field-models", "--train", "x.csv"], "go together"),
        (["multistate-friction", "--train", "x.csv", "--test", "y.csv"], "field-models only"),
        (["field-models", "--train", "x.csv", "--test", "y.csv"], "x.csv"),
    ],
)
def test_bad_calls_leave_with_a_remedy(cli: Cli, arguments: list[str], said: str) -> None:
    result = cli("reproduce", *arguments)
    assert result.code == 2
    assert said in result.err
    assert "Traceback" not in result.err


def test_unknown_papers_are_refused() -> None:
    with pytest.raises(ModelError, match="multistate-friction"):
        reproduce("nobody")
