"""Files about the project agree with pyproject.toml, and ask for what maintainers need."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from mckibben.version import versions
from tests.golden.commands import call

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def field(name: str, file: str) -> str:
    """Return the value of a field of a YAML file that is a single word or quoted."""
    found = re.search(rf"^ *{name}: *\"?(.*?)\"?$", (ROOT / file).read_text(), re.M)
    assert found, f"{file} has no field {name}"
    return found.group(1)


def test_the_citation_agrees_with_the_project() -> None:
    assert field("version", "CITATION.cff") == PROJECT["version"]
    assert field("license", "CITATION.cff") == PROJECT["license"]
    assert field("repository-code", "CITATION.cff") in PROJECT["urls"]["Changelog"]
    assert "# doi: " in (ROOT / "CITATION.cff").read_text() or field("doi", "CITATION.cff")


def test_the_conda_recipe_agrees_with_the_project() -> None:
    recipe = (ROOT / "recipe" / "recipe.yaml").read_text()
    lists = {
        name: set(re.findall(r"- (.*)", block))
        for name, block in re.findall(r"^  (host|run):\n((?:    - .*\n)+)", recipe, re.M)
    }
    python = f"python {PROJECT['requires-python']}"
    required = {line.replace(">=", " >=") for line in PROJECT["dependencies"]}
    assert lists["run"] == {python, *required}
    backend = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert lists["host"] == {python, "pip", *(line.replace(">=", " >=") for line in backend)}
    assert field("version", "recipe/recipe.yaml") == PROJECT["version"]
    assert field("summary", "recipe/recipe.yaml") == PROJECT["description"]
    (command,) = (f"{name} = {target}" for name, target in PROJECT["scripts"].items())
    assert f"- {command}\n" in recipe


def test_issue_templates_ask_for_versions() -> None:
    for name in ("bug", "feature"):
        text = (ROOT / ".github" / "ISSUE_TEMPLATE" / f"{name}.yml").read_text()
        assert "`mckibben info`" in text
    shown = json.loads(call("info", "--json").out)
    assert shown == versions()
    assert {"mckibben", "Python", "system", "numpy", "scipy", "numba"} <= set(shown)


def test_the_paper_is_short_and_its_sources_exist() -> None:
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    body = re.sub(r"<!--.*?-->", "", paper.split("---", 2)[2], flags=re.S)
    assert len(body.split()) <= 1000
    cited = set(re.findall(r"@(\w+)", body))
    listed = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(), re.M))
    assert cited == listed
    for picture in re.findall(r"\]\(([\w.]+\.png)\)", body):
        made = re.search(rf"<!-- python (\S+) paper/{picture} -->", paper)
        assert made, f"no command makes {picture}"
        assert (ROOT / made.group(1)).is_file()
        assert (ROOT / "paper" / picture).is_file()
