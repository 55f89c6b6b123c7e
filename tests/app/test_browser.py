"""What the workbench can do in a real browser, once each: files, parts, windows, keys, sizes, themes."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben.app.plots import colours
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from tests.app.browsing import (
    SLOW,
    TABS,
    downloaded,
    holds,
    idle,
    opened,
    seen,
    starting,
    upload,
    visited,
    workbench,
)
from tests.app.simulated import asked, filled, quiet, swung

playwright = pytest.importorskip("playwright.sync_api")

pytestmark = pytest.mark.long


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return an empty workspace."""
    return Workspace(tmp_path / "ws")


@pytest.fixture
def address(workspace: Workspace) -> Iterator[str]:
    with workbench(workspace.folder) as address:
        yield address


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Any]:
    with visited(browser, address) as page:
        yield page


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Give the address of a workbench with two recordings and two models, which nobody changes."""
    folder = tmp_path_factory.mktemp("fitted") / "ws"
    workspace = filled(folder)
    workspace.add(swung(7.0), origin="a test", call="spare", name="spare", role="unused")
    for model in ("pi", "gpi"):
        fit(workspace, asked(model, model), quiet)
    with workbench(folder) as found:
        yield found


def table(muscles: int, phase: float, *, load: bool = False) -> bytes:
    """Return a file of muscles that lag behind their pressures, on one arm or under a load."""
    t = np.arange(400) * 0.1
    columns = {"time_s": t}
    pressures = [
        2.5 - 1.5 * np.cos(t * (0.5 + 0.13 * k + 0.1 * phase) + phase * k) for k in range(muscles)
    ]
    for k, pressure in enumerate(pressures):
        suffix = f"_{k + 1}" if muscles > 1 else ""
        others = sum(pressures) - pressure
        lagging = pressure - 0.3 * np.sign(np.gradient(pressure)) - 0.1 * others
        columns[f"pressure{suffix}_bar"] = pressure
        columns[f"displacement{suffix}_mm"] = 6.0 * lagging
    if load:
        columns["force_N"] = 50.0 + 10.0 * np.sin(0.2 * t)
    rows = [",".join(f"{v:.5g}" for v in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join([",".join(columns), *rows]).encode()


def choose(page: Any, field: str, option: str) -> None:
    seen(page, field).click()
    page.get_by_role("option").filter(has_text=option).first.click()


# -- files ---------------------------------------------------------------------------------------


def test_a_file_that_needs_help_is_mapped_by_hand_and_read_otherwise(
    page: Any, workspace: Workspace
) -> None:
    t = np.arange(200) * 0.05
    rows = [f"{a:.3f};{300 + 100 * np.sin(a):.3f};{10 * np.cos(a):.3f}" for a in t]
    upload(page, rig=("t_s;P1;laser\n" + "\n".join(rows)).encode())
    seen(page, "problem")
    for place, channel, unit in ((1, "pressure", "kPa"), (2, "displacement", "mm")):
        choose(page, f"channel-{place}", channel)
        page.get_by_test_id(f"unit-{place}").fill(unit)
    seen(page, "read-again").click()
    seen(page, "recording-rig")
    first = workspace.recording("rig")
    assert first["pressure"].max() == pytest.approx(4.0, abs=0.01)
    page.get_by_label("How it was read: rig").click()
    seen(page, "sign-2").click()
    seen(page, "add-constant").click()
    seen(page, "constant-value-0").fill("200")
    seen(page, "constant-unit-0").fill("g")
    seen(page, "read-again").click()
    holds(page, lambda: "force" in workspace.recording("rig"))
    found = workspace.recording("rig")
    assert found["force"] == pytest.approx(1.96133)
    np.testing.assert_allclose(found["displacement"], -first["displacement"])
    page.get_by_test_id("read-again").wait_for(state="detached", timeout=SLOW)
    page.get_by_label("Remove rig").click()
    page.get_by_test_id("recording-rig").wait_for(state="detached", timeout=SLOW)
    page.keyboard.press("Control+z")
    seen(page, "recording-rig")


def test_many_and_hostile_files_get_one_summary(page: Any, workspace: Workspace) -> None:
    good = b"pressure_bar,displacement_mm\n" + b"1,2\n2,3\n" * 20
    files = [(f"run {k}.csv", good) for k in range(8)]
    files += [(f"photo{k}.jpg", b"\xff\xd8") for k in range(3)]
    files += [("<img src=x onerror=alert(1)>.csv", b"a,b\nx,y\n"), ("empty.csv", b"\n")]
    files += [("noise.mat", bytes(range(256)) * 20), ("bomb.parquet", b"PAR1" + b"\0" * 100)]
    files += [("../../evil.csv", b"pressure_bar,displacement_mm\n1,2\n")]
    late: list[Any] = []

    def hold(route: Any) -> None:
        """Let all but the last file in at once, and that when the others have long been read."""
        late.append(route)
        if len(late) < len(files):
            route.continue_()

    page.route("**/upload/**", hold)
    seen(page, "upload")
    page.locator("input[type=file]").first.set_input_files(
        [{"name": name, "mimeType": "text/plain", "buffer": data} for name, data in files]
    )
    holds(page, lambda: len(late) == len(files))
    page.wait_for_timeout(1500)
    assert page.get_by_test_id("not-read").count() == 0
    late[-1].continue_()
    assert seen(page, "not-read").inner_text().startswith("8")
    assert page.locator("[data-testid^=recording-run]").count() == 8
    assert len(workspace.entries()) == 8
    assert page.locator(".q-notification").count() <= 1


def test_a_part_is_cut_by_dragging_and_by_keys_and_taken_back(
    page: Any, workspace: Workspace
) -> None:
    seen(page, "example").click()
    name = "decaying-triangle"
    seen(page, f"recording-{name}")
    whole = len(workspace.recording(name))
    box = seen(page, "preview-plot").locator(".nsewdrag").first.bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"], steps=5)
    page.mouse.up()
    page.wait_for_timeout(500)
    seen(page, "keep").click()
    seen(page, "steps")
    assert len(workspace.recording(name)) / whole == pytest.approx(0.25, abs=0.03)
    seen(page, "undo").click()
    seen(page, "steps").wait_for(state="detached")
    assert len(workspace.recording(name)) == whole
    seen(page, "select-part").focus()
    for key in ("ArrowRight", "Shift+ArrowRight", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    seen(page, "steps")
    assert len(workspace.recording(name)) / whole == pytest.approx(0.52, abs=0.01)


# -- from files to what is taken away ------------------------------------------------------------


def modelled(page: Any, *models: str, muscles: int, load: bool = False) -> None:
    """Go from two files, one for the test, to models on the leaderboard, which are ticked at first."""
    for name, phase in (("first", 0.4), ("second", 1.1)):
        upload(page, **{name: table(muscles, phase, load=load)})
        seen(page, f"recording-{name}")
    seen(page, "role-second").get_by_text("test", exact=True).click()
    seen(page, "tab-look").click()
    seen(page, "loop-plot")
    seen(page, "tab-models").click()
    for model in models:
        assert seen(page, f"model-{model}").get_attribute("aria-checked") == "true"
    seen(page, "untick").click()
    for model in models:
        seen(page, f"model-{model}").click()
    seen(page, "fit").click()
    for model in models:
        seen(page, "leaderboard").get_by_text(model).first.wait_for(timeout=SLOW)
    seen(page, "tab-compensate").click()


def test_an_arm_from_files_to_its_compensator(page: Any) -> None:
    modelled(page, "balance", "coupled-memory", muscles=3)
    seen(page, "wave").click()
    seen(page, "show-pressures").click()
    first = downloaded(page, "take-pressures").splitlines()[0]
    assert first == b"time_s,pressure_1_bar,pressure_2_bar,pressure_3_bar"
    seen(page, "run-loop").click()
    seen(page, "runs").get_by_text("balance-feedforward").first.wait_for(timeout=SLOW)
    seen(page, "loop-runs-3")
    seen(page, "tab-take").click()
    chosen = page.locator(".q-field", has=page.get_by_test_id("take-form"))
    chosen.get_by_text("compensator").wait_for(timeout=SLOW)
    assert (
        json.loads(downloaded(page, "take-json"))["kind"] == "balance"
    )  # its inverse is the model


def test_a_load_from_files_to_its_estimate(page: Any) -> None:
    modelled(page, "pi", "balance", muscles=1, load=True)
    seen(page, "forces").locator(".q-item, .q-expansion-item__toggle").first.click()
    seen(page, "estimate-force").click()
    seen(page, "force-plot")
    seen(page, "force-balance-second")
    assert b'"load-estimate"' in downloaded(page, "take-force")


# -- the page itself -----------------------------------------------------------------------------


def test_two_windows_follow_each_other_and_panels_are_drawn_again(page: Any, address: str) -> None:
    seen(page, "example").click()
    run = "recording-irregular-triangle"
    seen(page, run)
    other = page.context.browser.new_page()
    other.goto(address)
    seen(other, run)
    page.get_by_label("Remove irregular-triangle").click()
    for window in (page, other):
        window.get_by_test_id(run).wait_for(state="detached", timeout=SLOW)
    seen(page, "tab-look").click()
    seen(page, "characterization").locator("li, td").first.wait_for(timeout=SLOW)
    other.get_by_label("Undo: remove").click()
    seen(other, run)
    seen(page, "untold").locator("*").first.wait_for(timeout=SLOW)
    assert page.get_by_test_id("characterization").count() == 1
    seen(page, "tab-data").click()
    seen(page, run)


def test_back_and_reload_lead_to_the_step_before_and_ticks_stay(browser: Any, fitted: str) -> None:
    def at(page: Any, tab: str) -> None:
        chosen = page.get_by_test_id(f"tab-{tab}").and_(page.locator("[aria-selected=true]"))
        chosen.wait_for(timeout=SLOW)

    with visited(browser, fitted) as page:
        opened(page, "models")
        seen(page, "untick").click()
        seen(page, "about-pi").click()
        ticked = seen(page, "model-pi").and_(page.locator("[aria-checked=true]"))
        ticked.wait_for()
        opened(page, "look")
        page.go_back()
        at(page, "models")
        page.go_back()
        at(page, "data")
        assert "tab=" not in page.url
        page.go_forward()
        at(page, "models")
        assert "tab=Models" in page.url
        page.reload()
        at(page, "models")
        ticked.wait_for()
        assert page.locator("[data-testid^=model-][aria-checked=true]").count() == 1


PICTURED = """() => [...document.querySelectorAll(".js-plotly-plot")]
  .filter((plot) => plot.checkVisibility() && plot._fullLayout)
  .map((plot) => [plot._fullLayout.font.color, plot._fullLayout.yaxis.gridcolor])"""


def test_all_pictures_follow_the_theme(browser: Any, fitted: str) -> None:
    wanted = [[colours(dark)[name] for name in ("ink", "grid")] for dark in (False, True)]
    drawn = f"wanted => ({PICTURED})().every((one) => `${{one}}` === `${{wanted}}`)"
    with visited(browser, fitted, color_scheme="dark") as page:
        page.wait_for_function("document.body.classList.contains('body--dark')")
        for tab in TABS:
            opened(page, tab)
            if tab in ("data", "look", "models"):
                page.wait_for_function(f"({PICTURED})().length > 0", timeout=SLOW)
        for tab in TABS:
            opened(page, tab)
            for theme in (False, True):
                seen(page, "theme").click()
                page.wait_for_function(drawn, arg=wanted[theme], timeout=SLOW)


NAMELESS = """() => {
  const named = (element) => {
    const by = element.getAttribute("aria-labelledby");
    const labels = [...(element.labels ?? [])].map((label) => label.innerText).join(" ");
    const inner = [...element.querySelectorAll("[aria-label]")].map((one) => one.ariaLabel);
    const text = element.matches("input, textarea, select") ? "" : element.innerText;
    return [element.getAttribute("aria-label"), by && document.getElementById(by)?.innerText,
      labels, ...inner, text, element.title, element.getAttribute("placeholder")]
      .some((name) => name && name.trim());
  };
  const wanted = "button, a[href], input:not([type=hidden], [type=file]), textarea, select, "
    + "[role=button], [role=tab], [role=checkbox], [role=switch], [role=combobox]";
  return [...document.querySelectorAll(wanted)]
    .filter((element) => element.checkVisibility() && !element.closest("[aria-hidden=true]"))
    .filter((element) => !named(element)).map((element) => element.outerHTML.slice(0, 200));
}"""


def test_screen_readers_and_keys_reach_everything(browser: Any, fitted: str) -> None:
    with visited(browser, fitted, reduced_motion="reduce") as page:
        idle(page)
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")  # skips the header
        assert page.evaluate("document.activeElement.id") == "content"
        seen(page, "tab-data").focus()
        page.keyboard.press("ArrowRight")
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert page.evaluate(outline) != "none"
        page.keyboard.press("Enter")
        seen(page, "loop-plot")
        for role in ("banner", "main", "tablist"):
            assert page.get_by_role(role).count() == 1
        for tab in TABS:
            opened(page, tab)
            page.wait_for_function(f"() => ({NAMELESS})().length === 0", timeout=60_000)


def test_every_step_fits_a_phone(browser: Any, fitted: str) -> None:
    size = {"width": 400, "height": 800}
    with visited(browser, fitted, viewport=size, has_touch=True, is_mobile=True) as page:
        for tab in TABS:
            opened(page, tab)
            assert page.evaluate("document.documentElement.scrollWidth") <= 400, tab
            box = seen(page, f"tab-{tab}").bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 400
            assert box["height"] >= 40
        opened(page, "data")
        seen(page, "rig").click()
        box = page.get_by_role("dialog").locator(".q-card").first.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 400


def test_models_are_set_compared_and_logged(browser: Any, fitted: str) -> None:
    with visited(browser, fitted) as page:
        opened(page, "models")
        seen(page, "settings-gpi").click()
        seen(page, "set-n_operators").fill("7")
        seen(page, "settings-done").click()
        seen(page, "leaderboard").locator("tbody .q-checkbox").nth(1).click()
        for model in ("pi", "gpi"):
            page.get_by_text(f"Parameters of {model}").wait_for(timeout=SLOW)
        seen(page, "log").locator(".q-item, .q-expansion-item__toggle").first.click()
        seen(page, "log").get_by_label("Copy").wait_for()


def test_a_browser_waits_at_the_door_and_is_let_in(browser: Any, tmp_path: Path) -> None:
    with starting(tmp_path / "ws") as process:
        while not (found := list((tmp_path / "ws").glob(".open-*.html"))):
            assert process.poll() is None
            time.sleep(0.01)
        page = browser.new_page()
        page.goto(found[0].as_uri())
        seen(page, "tab-data")
        page.close()
