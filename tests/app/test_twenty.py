"""Twenty things that a new user does, each in a real browser and in no more clicks than said here.

Writing into a field, pressing a key and choosing a file are no clicks; opening a list is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mckibben.app.work import fit
from tests.app.browsing import SLOW, opened, seen, visited, workbench
from tests.app.test_jobs import filled, swung
from tests.app.test_jobs import fit as asked

pytest.importorskip("playwright.sync_api")

CSV = "time_s,pressure_bar,displacement_mm\n" + "\n".join(
    f"{0.1 * k:.1f},{1 + k % 40 / 10},{2 * (k % 40)}" for k in range(200)
)


@dataclass
class Hand:
    """A hand on the mouse that counts its clicks."""

    page: Any
    clicks: int = 0

    def on(self, name: str) -> Any:
        """Click what has a name for tests; of a tab, wait until what is on it is there."""
        if name.startswith("tab-"):
            self.clicks += 1
            return opened(self.page, name.removeprefix("tab-"))
        return self.at(seen(self.page, name))

    def at(self, place: Any) -> Any:
        """Click a place."""
        self.clicks += 1
        place.click(timeout=SLOW)
        return place

    def gets(self, name: str) -> bytes:
        """Click what gives a file, and return that."""
        with self.page.expect_download(timeout=SLOW) as download:
            self.on(name)
        return Path(download.value.path()).read_bytes()

    def sees(self, text: str) -> None:
        """Wait for words."""
        self.page.get_by_text(text).first.wait_for(timeout=SLOW)


def opens_the_example(hand: Hand) -> None:
    hand.on("example")
    seen(hand.page, "recording-irregular-triangle")


def brings_a_file(hand: Hand) -> None:
    file = {"name": "mine.csv", "mimeType": "text/csv", "buffer": CSV.encode()}
    hand.page.locator("input[type=file]").first.set_input_files(file)
    seen(hand.page, "recording-mine")


def keeps_a_recording_for_the_test(hand: Hand) -> None:
    hand.at(seen(hand.page, "role-spare").get_by_text("test", exact=True))
    pressed = seen(hand.page, "role-spare").locator("[aria-pressed=true]")
    pressed.get_by_text("test", exact=True).wait_for()


def sees_a_recording_over_time(hand: Hand) -> None:
    hand.at(hand.page.get_by_label("Show run"))
    seen(hand.page, "preview-plot").locator(".main-svg").first.wait_for()


def looks_into_a_virtual_rig(hand: Hand) -> None:
    hand.on("rig")
    seen(hand.page, "protocol")


def changes_to_the_dark(hand: Hand) -> None:
    hand.at(hand.page.get_by_label("Light or dark"))
    hand.page.wait_for_function("document.body.classList.contains('body--dark')")


def sees_the_loop(hand: Hand) -> None:
    hand.on("tab-look")
    seen(hand.page, "loop-plot").locator(".main-svg").first.wait_for()


def reads_what_the_muscle_does(hand: Hand) -> None:
    hand.on("tab-look")
    seen(hand.page, "characterization").get_by_text("loop").first.wait_for(timeout=SLOW)


def reads_what_is_missing(hand: Hand) -> None:
    hand.on("tab-look")
    hand.sees("no input is ever held")


def sees_where_it_is_fast(hand: Hand) -> None:
    hand.on("tab-look")
    hand.at(seen(hand.page, "loop-colour").get_by_text("Colour by rate"))
    seen(hand.page, "loop-plot").locator(".cbaxis, .colorbar").first.wait_for()


def fits_a_model(hand: Hand) -> None:
    hand.on("tab-models")
    hand.on("untick")
    hand.on("model-mpi")
    hand.on("fit")
    seen(hand.page, "leaderboard").get_by_text("mpi").first.wait_for(timeout=SLOW)


def sees_which_is_best(hand: Hand) -> None:
    hand.on("tab-models")
    seen(hand.page, "leaderboard").get_by_text("gpi").first.wait_for()


def compares_two_models(hand: Hand) -> None:
    hand.on("tab-models")
    hand.at(seen(hand.page, "leaderboard").locator("tbody .q-checkbox").nth(1))
    hand.page.get_by_text("Parameters of pi").wait_for(timeout=SLOW)
    hand.page.get_by_text("Parameters of gpi").wait_for(timeout=SLOW)


def reads_parameters(hand: Hand) -> None:
    hand.on("tab-models")
    hand.at(hand.page.get_by_text("Parameters of").first)
    hand.sees("weights 1")


def changes_settings(hand: Hand) -> None:
    hand.on("tab-models")
    hand.on("settings-gpi")
    seen(hand.page, "set-n_operators").fill("7")
    hand.on("settings-done")


def sees_the_pressures_for_a_wave(hand: Hand) -> None:
    hand.on("tab-compensate")
    hand.on("wave")
    hand.on("show-pressures")
    seen(hand.page, "pressure-plot")


def tries_it_in_a_closed_loop(hand: Hand) -> None:
    sees_the_pressures_for_a_wave(hand)
    hand.on("run-loop")
    seen(hand.page, "runs").get_by_text("feedforward").first.wait_for(timeout=SLOW)


def takes_the_model_along(hand: Hand) -> None:
    hand.on("tab-take")
    assert hand.gets("take-json").startswith(b'{\n  "format": "mckibben-model"')


def takes_c_along(hand: Hand) -> None:
    hand.on("tab-take")
    assert hand.gets("take-c").startswith(b"PK")


def takes_a_figure_along(hand: Hand) -> None:
    hand.on("tab-take")
    assert hand.gets("take-figure").startswith(b"%PDF")


def takes_the_script_along(hand: Hand) -> None:
    hand.on("tab-take")
    assert b"mckibben.compare" in hand.gets("take-script")


def sees_what_was_done(hand: Hand) -> None:
    hand.at(seen(hand.page, "log").get_by_text("What was done"))
    seen(hand.page, "log").get_by_label("Copy").wait_for()


THINGS: dict[Callable[[Hand], None], int] = {
    opens_the_example: 1,
    brings_a_file: 0,
    keeps_a_recording_for_the_test: 1,
    sees_a_recording_over_time: 1,
    looks_into_a_virtual_rig: 1,
    changes_to_the_dark: 1,
    sees_the_loop: 1,
    reads_what_the_muscle_does: 1,
    reads_what_is_missing: 1,
    sees_where_it_is_fast: 2,
    sees_which_is_best: 1,
    compares_two_models: 2,
    reads_parameters: 2,
    changes_settings: 3,
    fits_a_model: 4,
    sees_the_pressures_for_a_wave: 3,
    tries_it_in_a_closed_loop: 4,
    takes_the_model_along: 2,
    takes_c_along: 2,
    takes_a_figure_along: 2,
    takes_the_script_along: 2,
    sees_what_was_done: 1,
}
"""What a person does, and in how many clicks at most."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A workbench with two recordings and two models."""
    folder = tmp_path_factory.mktemp("twenty") / "ws"
    workspace = filled(folder)
    workspace.add(swung(7.0), origin="a test", call="spare", name="spare", role="unused")
    for model in ("pi", "gpi"):
        fit(workspace, asked(model, model), lambda share, cost: None)
    with workbench(folder) as found:
        yield found


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A workbench with nothing in it: what is brought to it is not in others' way."""
    with workbench(tmp_path_factory.mktemp("empty") / "ws") as found:
        yield found


@pytest.mark.parametrize("thing", THINGS, ids=lambda thing: str(thing.__name__))
def test_a_new_user(
    browser: Any, request: pytest.FixtureRequest, thing: Callable[[Hand], None]
) -> None:
    place = "empty" if thing in (opens_the_example, brings_a_file) else "address"
    with visited(browser, request.getfixturevalue(place)) as page:
        hand = Hand(page)
        thing(hand)
        assert hand.clicks <= THINGS[thing]


def test_there_are_twenty() -> None:
    assert len(THINGS) >= 20
