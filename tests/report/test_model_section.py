"""The section of a page that says what a model is."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from scipy.signal import lfilter

from mckibben import PI, Recording
from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.report import templating
from mckibben.report.description_subjects import figures
from mckibben.report.mathematics import ATTRIBUTES, ELEMENTS, mathml
from mckibben.validation.describing import ModelDescription, describe

STEP = 0.05


def described(block: Block, memory: float = 0.0, fitted: bool = True) -> ModelDescription:
    u = 2.5 - 2.3 * np.cos(2 * np.pi * 5 * np.arange(2000) / 2000)
    u += np.random.default_rng(0).uniform(-0.1, 0.1, u.size)
    shocks: Array = np.random.default_rng(1).normal(0, 0.05, u.size)
    y = np.asarray(block.simulate(u, sample_time=STEP)) + lfilter([1.0], [1.0, -memory], shocks)
    given, wanted = block.inputs[0], block.outputs[0]
    channels = {given.name: u, wanted.name: y}
    units = {given.name: given.unit, wanted.name: wanted.unit}
    return describe(block, [Recording(channels, STEP, units=units)], fitted=fitted)


def section(found: ModelDescription) -> str:
    template = templating.template("_model.html.j2")
    return template.render(description=found, figures=figures(found))


def test_equations_parameters_and_plots_are_there() -> None:
    found = described(PI((0.0, 0.3, 0.8), (3.0, 1.5, 0.9), 2.0), 0.9)
    text = section(found)
    assert text.count("<math") > 5
    assert "not given: the free run&#39;s residuals are correlated" in text
    for one in found.parameters:
        assert f'<th scope="row" class="unit">{one.name}</th>' in text
        assert one.unit in text
    assert 'data-figure="response displacement"' in text
    assert "Hysteresis is late" in text


def test_criteria_are_given_where_they_mean_something() -> None:
    text = section(described(TransferFunction((0.4, 0.2), (-0.7,), STEP)))
    assert re.search(r"AIC −[\d.]+", text)
    assert "thin lines hold" in text


def test_names_from_files_are_shown_verbatim() -> None:
    """A channel's name is text, in equations as elsewhere: neither markup nor LaTeX."""
    name = r"<script>alert(1)</script>_\frac{a"
    block = PI((0.0, 0.3), (3.0, 1.5), 2.0, input=Channel(name, "bar"))
    text = section(described(block))
    assert "<script" not in text
    assert "<mfrac>" not in text
    assert "<code>" not in text


HOSTILE = (
    r"\href{javascript:alert(1)}{mm}",
    r"}\href{javascript:alert(1)}{x}\mathrm{",
    '"><img src=x onerror=alert(1)>',
    r"\style{background:url(//x)}{mm}",
)


@pytest.mark.parametrize("unit", HOSTILE)
def test_units_and_names_from_files_lead_nowhere(unit: str) -> None:
    """Neither links nor events nor styles: whatever a file calls its channels and their units."""
    block = PI(
        (0.0, 0.3), (3.0, 1.5), 2.0, input=Channel(unit, unit), output=Channel("bend" + unit, unit)
    )
    shown = Tags()
    shown.feed(section(described(block)))
    assert {"math", "table"} <= shown.tags
    assert not shown.tags & {"img", "script", "a", "iframe"}
    assert not {name for name in shown.attributes if name.startswith("on")}
    assert not shown.attributes & {"href", "src", "style", "xlink:href"}


@pytest.mark.parametrize(
    "latex", [r"\href{javascript:alert(1)}{x}", r"\style{color:red}{x}", r"\class{y}{x}"]
)
def test_equations_are_set_with_what_leads_nowhere(latex: str) -> None:
    shown = Tags()
    shown.feed(mathml(latex))
    assert shown.attributes <= ATTRIBUTES
    assert shown.tags <= ELEMENTS | {"code"}


class Tags(HTMLParser):
    """All tags and attributes of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag and its attributes."""
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}


def test_of_recordings_not_fitted_to_the_page_says_so() -> None:
    block = TransferFunction((0.4, 0.2), (-0.7,), STEP)
    found = described(block, fitted=False)
    text = section(found)
    assert found.criteria.aic is None
    assert "as a fit to these recordings would have them" in text
    assert "not by others" in text
    assert "those of the fit to" in section(described(block))
