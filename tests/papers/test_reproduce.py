"""Re-runs of papers: on small data, through Python and through the command line."""

from __future__ import annotations

import json

import pytest

from mckibben import registry
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture


def test_list_names_every_paper(cli: Cli) -> None:
    listed = json.loads(cli("reproduce", "--list", "--json").out)
    assert sorted(listed) == sorted(registry.names("papers"))
    assert all(listed.values())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nobody"], "nobody"),
        ([], "--list"),
        (["field-models", "--train", "x.csv"], "--test"),
        (["multistate-friction", "--train", "x.csv", "--test", "y.csv"], "field-models"),
        (["field-models", "--train", "x.csv", "--test", "y.csv"], "x.csv"),
    ],
)
def test_bad_calls_leave_with_a_remedy(cli: Cli, arguments: list[str], said: str) -> None:
    result = cli("reproduce", *arguments)
    assert result.code == 2
    assert said in result.err
    assert "Traceback" not in result.err
