"""A real browser walks the whole way, from the example to a C folder, and asks nobody else."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.app.browsing import SLOW, opened, seen, visited, workbench
from tests.tools import where

pytest.importorskip("playwright.sync_api")


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Start the workbench on a free port, and give its address."""
    with workbench(tmp_path / "ws") as address:
        yield address
    if (
        os.name == "posix"
    ):  # all that it wrote is for nobody else, whatever the rights of this process
        assert not [path for path in (tmp_path / "ws").rglob("*") if path.stat().st_mode & 0o077]


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Any]:
    """Open the workbench in a browser that tells of foreign requests and errors."""
    with visited(browser, address) as page:
        yield page


def downloaded(page: Any, name: str) -> bytes:
    with page.expect_download(timeout=SLOW) as download:
        seen(page, name).click()
    return Path(download.value.path()).read_bytes()


def test_from_the_example_to_a_c_folder(page: Any, tmp_path: Path) -> None:
    assert "Nothing here yet" in seen(page, "empty").inner_text()
    seen(page, "example").click()
    seen(page, "recording-irregular-triangle")
    seen(page, "preview-plot")

    seen(page, "tab-look").click()
    seen(page, "loop-plot")
    page.get_by_text("asymmetric loop").wait_for(timeout=SLOW)

    seen(page, "tab-models").click()
    seen(page, "untick").click()
    for name in ("pi", "mpi"):
        seen(page, f"model-{name}").click()
    seen(page, "fit").click()
    seen(page, "leaderboard").get_by_text("mpi").wait_for(timeout=SLOW)
    seen(page, "closer-0")

    seen(page, "tab-compensate").click()
    seen(page, "wave").click()
    page.wait_for_function(
        "document.querySelector('[data-testid=points]').value.split('\\n').length > 10"
        " || [...document.querySelectorAll('textarea')].some(t => t.value.split('\\n').length > 10)"
    )
    seen(page, "show-pressures").click()
    seen(page, "pressure-plot")
    assert downloaded(page, "take-pressures").startswith(b"time_s,pressure_bar\n0,")
    seen(page, "run-loop").click()
    page.get_by_test_id("runs").get_by_text("feedforward-pid").first.wait_for(timeout=SLOW)

    seen(page, "tab-take").click()
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "take-c"))) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    assert any(name.endswith("CMakeLists.txt") for name in names)
    if where("cc"):
        from mckibben.export.c.building import self_test

        folder = tmp_path / names[0].split("/")[0]
        assert "largest difference" in self_test(folder, folder.name.removesuffix("-c"))
    assert downloaded(page, "take-json").startswith(b'{\n  "format": "mckibben-model"')
    assert b"mckibben.compare" in downloaded(page, "take-script")
    assert downloaded(page, "take-figure").startswith(b"%PDF")
    seen(page, "take-report").click()
    assert b"<html" in downloaded(page, "get-report")
    assert "models=" in page.locator("body").inner_text()


def test_back_is_the_step_before_and_ticks_stay(page: Any) -> None:
    def at(tab: str) -> None:
        page.wait_for_function(
            "name => document.querySelector(`[data-testid=tab-${name}]`)"
            ".getAttribute('aria-selected') === 'true'",
            arg=tab,
        )

    seen(page, "example").click()
    seen(page, "recording-irregular-triangle")
    opened(page, "models")
    seen(page, "untick").click()
    seen(page, "about-pi").click()
    seen(page, "model-pi").and_(page.locator("[aria-checked=true]")).wait_for()
    opened(page, "look")
    page.go_back()
    at("models")
    page.go_back()
    at("data")
    assert "tab=" not in page.url
    page.go_forward()
    at("models")
    assert "tab=Models" in page.url
    page.go_forward()
    at("look")
    page.go_back()
    at("models")
    page.reload()
    seen(page, "model-pi").and_(page.locator("[aria-checked=true]")).wait_for()
    assert page.locator("[data-testid^=model-][aria-checked=true]").count() == 1


def upload(page: Any, name: str, content: bytes) -> None:
    page.locator("input[type=file]").first.set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": content}
    )


def test_a_file_that_needs_help_is_mapped_by_hand(page: Any) -> None:
    t = np.arange(200) * 0.05
    rows = [f"{a:.3f};{300 + 100 * np.sin(a):.3f};{10 * np.cos(a):.3f}" for a in t]
    seen(page, "upload")
    upload(page, "rig.csv", ("t_s;P1;laser\n" + "\n".join(rows)).encode())
    problem = seen(page, "problem").inner_text()
    assert "Remedy" in problem
    numbers = seen(page, "first-1").locator(":scope > *").all()  # whole, each on one line
    assert len(numbers) > 1
    assert max(one.bounding_box()["height"] for one in numbers) < 24
    for place, channel, unit in ((1, "pressure", "kPa"), (2, "displacement", "mm")):
        page.get_by_test_id(f"channel-{place}").click()
        page.get_by_role("option", name=channel, exact=True).click()
        page.get_by_test_id(f"unit-{place}").fill(unit)
    seen(page, "read-again").click()
    assert "pressure [bar]" in seen(page, "recording-rig").inner_text()


def test_a_load_told_of_one_file_is_not_that_of_another(page: Any) -> None:
    lines = [
        f"{line},{7 if k else 'counter'}"
        for k, line in enumerate(swung(1, 0.4).decode().splitlines())
    ]
    torn = "\n".join(lines[:100] + lines[150:]).encode()  # which is asked about
    seen(page, "upload")
    files = [{"name": f"{n}.csv", "mimeType": "text/csv", "buffer": torn} for n in ("one", "two")]
    page.locator("input[type=file]").first.set_input_files(files)
    seen(page, "not-read").get_by_text("How is it to be read?").first.click()
    seen(page, "add-constant").click()
    seen(page, "constant-value-0").fill("20")
    seen(page, "channel-3").click()
    page.get_by_role("option").filter(has_text="(left out)").click()
    assert seen(page, "alike").get_attribute("aria-checked") == "true"
    assert seen(page, "alike-constants").get_attribute("aria-checked") == "false"
    seen(page, "read-again").click()
    assert "force 20 N" in seen(page, "recording-one").inner_text()
    assert "force" not in seen(page, "recording-two").inner_text()


HOSTILE = {
    "../../evil.csv": b"pressure_bar,displacement_mm\n1,2\n",
    "empty.csv": b"\n",
    "<img src=x onerror=alert(1)>.csv": b"a,b\nx,y\n",
    "noise.mat": bytes(range(256)) * 20,
    "bomb.parquet": b"PAR1" + b"\0" * 100,
}


def test_hostile_files_get_a_message(page: Any) -> None:
    for name, content in HOSTILE.items():
        seen(page, "upload")
        upload(page, name, content)
        page.get_by_text("Remedy").first.wait_for(timeout=SLOW)
        assert seen(page, "empty").is_visible()
        page.reload()


def test_it_fits_a_narrow_window_in_the_dark_and_the_keyboard(page: Any) -> None:
    page.emulate_media(color_scheme="dark")
    page.set_viewport_size({"width": 800, "height": 700})
    page.reload()
    seen(page, "example")
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= 800
    page.wait_for_function("document.body.classList.contains('body--dark')")
    seen(page, "example").focus()
    page.keyboard.press("Enter")
    seen(page, "recording-decaying-triangle")
    seen(page, "tab-data").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    seen(page, "loop-plot")
    assert page.evaluate("document.documentElement.scrollWidth") <= 800


def test_a_part_is_kept_by_dragging_across_the_plot(page: Any) -> None:
    seen(page, "example").click()
    seen(page, "recording-decaying-triangle")
    area = seen(page, "preview-plot").locator(".nsewdrag").first
    area.wait_for()
    box = area.bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"], steps=5)
    page.mouse.up()
    page.wait_for_timeout(500)
    seen(page, "keep").click()
    seen(page, "steps")
    assert 1000 < samples(page) < 1250
    seen(page, "undo").click()
    seen(page, "steps").wait_for(state="detached")
    assert samples(page) > 4000


def samples(page: Any) -> int:
    said = seen(page, "recording-decaying-triangle").inner_text()
    return int(said.split(" samples")[0].split()[-1])


def test_a_part_is_kept_by_keys(page: Any) -> None:
    seen(page, "example").click()
    seen(page, "preview-plot")
    before = samples(page)
    seen(page, "select-part").focus()
    for key in ("ArrowRight", "Shift+ArrowRight", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    seen(page, "steps")
    assert abs(samples(page) / before - 0.52) < 0.01


def test_how_a_file_was_read_is_come_back_to(page: Any) -> None:
    rows = "\n".join(f"{k % 20},{300 + k % 40},{-(k % 7)},up" for k in range(200))
    seen(page, "upload")
    upload(page, "levels.csv", f"level,p_kPa,displacement_mm,branch\n{rows}".encode())
    said = seen(page, "understood-levels").inner_text()
    assert "no time" in said
    assert "branch" in said
    page.get_by_label("How it was read: levels").click()
    seen(page, "sign-2").click()
    seen(page, "rate").fill("50")
    seen(page, "read-again").click()
    page.get_by_test_id("recording-levels").get_by_text("3.98 s").wait_for(timeout=SLOW)
    page.get_by_label("Remove levels").click()
    page.get_by_test_id("recording-levels").wait_for(state="detached", timeout=SLOW)
    page.keyboard.press("Control+z")
    seen(page, "recording-levels")


def test_many_files_get_one_summary(page: Any) -> None:
    table = b"pressure_bar,displacement_mm\n" + b"1,2\n2,3\n" * 20
    files = [(f"run {k}.csv", table) for k in range(8)]
    files += [(f"photo{k}.jpg", b"\xff\xd8") for k in range(10)]
    files += [("<img src=x onerror=alert(1)>.csv", b"a,b\nx,y\n")]
    seen(page, "upload")
    page.locator("input[type=file]").first.set_input_files(
        [{"name": name, "mimeType": "text/plain", "buffer": data} for name, data in files]
    )
    said = seen(page, "not-read").inner_text()
    assert "11 file(s) were not read" in said
    assert "10 cannot be recordings" in said
    assert page.locator("[data-testid^=recording-run]").count() == 8
    assert page.locator(".q-notification").count() <= 1


def test_two_tabs_on_one_workbench(page: Any, address: str) -> None:
    seen(page, "example").click()
    run = "recording-irregular-triangle"
    seen(page, run)
    other = page.context.browser.new_page()
    other.goto(address)
    seen(other, run)
    page.get_by_label("Remove irregular-triangle").click()
    page.get_by_test_id(run).wait_for(state="detached", timeout=SLOW)
    other.get_by_test_id(run).wait_for(state="detached", timeout=SLOW)
    other.get_by_label("Undo: remove").click()
    seen(page, run)
    seen(other, "recording-decaying-triangle")
    seen(page, "recording-decaying-triangle")


def swung(muscles: int, phase: float, *, load: bool = False) -> bytes:
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


def modelled(page: Any, *models: str, muscles: int, load: bool = False) -> None:
    """Go from two files, one for the test, to models on the leaderboard, which are ticked at first."""
    for name, phase in (("first", 0.4), ("second", 1.1)):
        seen(page, "upload")
        upload(page, f"{name}.csv", swung(muscles, phase, load=load))
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


def shown(page: Any, field: str, text: str) -> None:
    """Wait until a field shows a text."""
    place = page.locator(".q-field", has=page.get_by_test_id(field))
    place.get_by_text(text).wait_for(timeout=SLOW)


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
    shown(page, "take-form", "its compensator")
    taken = json.loads(downloaded(page, "take-json"))
    assert taken["kind"] == "balance"  # whose inverse the model is


def test_a_load_from_files_to_its_estimate(page: Any) -> None:
    modelled(page, "pi", "balance", muscles=1, load=True)
    seen(page, "forces").get_by_text("Estimate a force").click()
    seen(page, "estimate-force").click()
    seen(page, "force-plot")
    assert "% of the measured range" in seen(page, "force-balance-second").inner_text()
    assert b'"load-estimate"' in downloaded(page, "take-force")


def test_results_appear_every_time_without_a_reload(page: Any) -> None:
    """The button stands in what its change draws anew; no panel is left empty by that."""
    upload(page, "one.csv", swung(1, 0.4))
    seen(page, "recording-one")
    seen(page, "tab-look").click()
    for number in range(4):
        seen(page, "tab-data").click()
        upload(page, f"more-{number}.csv", swung(1, 0.1 * number))
        seen(page, f"recording-more-{number}")
        page.get_by_label(f"Remove more-{number}").click()
        page.get_by_test_id(f"recording-more-{number}").wait_for(state="detached")
        seen(page, "tab-look").click()
        seen(page, "characterization").get_by_text("loop").first.wait_for(timeout=SLOW)
        seen(page, "untold").locator("*").first.wait_for(timeout=SLOW)
        assert page.get_by_test_id("characterization").count() == 1
