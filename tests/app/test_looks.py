"""Everybody can read it and reach it: contrast, the phone, names for screen readers, the keyboard."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest

from mckibben.app.plots import colours
from mckibben.app.theme import DARK, LIGHT, WRITTEN, contrast
from mckibben.app.work import fit
from tests.app.browsing import SLOW, TABS, idle, opened, seen, visited, workbench
from tests.app.test_jobs import filled
from tests.app.test_jobs import fit as asked

playwright = pytest.importorskip("playwright.sync_api")

LEAST, LEAST_LARGE = 4.5, 3.0
"""Contrasts that WCAG 2 demands at level AA, of text and of large text."""


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_the_colours_of_a_theme_can_be_read(theme: dict[str, str]) -> None:
    low = {
        f"{text} on {ground}": round(contrast(theme[text], theme[ground]), 2)
        for text, ground in WRITTEN
        if contrast(theme[text], theme[ground]) < LEAST
    }
    assert low == {}


def test_contrast_is_that_of_wcag() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A workbench with a recording, two models, and nothing that runs."""
    folder = tmp_path_factory.mktemp("looks") / "ws"
    workspace = filled(folder)
    for model in ("pi", "gpi"):
        fit(workspace, asked(model, model), lambda share, cost: None)
    with workbench(folder) as found:
        yield found


FAINT = """() => {
  const parse = (text) => {
    const found = text.match(/rgba?\\(([^)]+)\\)/);
    if (found) {
      const [r, g, b, a = 1] = found[1].split(/[ ,/]+/).map(Number);
      return [r, g, b, a];
    }
    const mixed = text.match(/color\\(srgb ([^)]+)\\)/);
    if (mixed) {
      const [r, g, b, a = 1] = mixed[1].split(/[ /]+/).map(Number);
      return [255 * r, 255 * g, 255 * b, a];
    }
    const canvas = document.createElement("canvas").getContext("2d");
    canvas.fillStyle = text;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = (top, below) => {
    const a = top[3];
    return [0, 1, 2].map((k) => top[k] * a + below[k] * (1 - a)).concat(1);
  };
  const light = (c) => {
    const f = (v) => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4 };
    return 0.2126 * f(c[0]) + 0.7152 * f(c[1]) + 0.0722 * f(c[2]);
  };
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  let seen = 0;
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const text = walker.currentNode.textContent.trim();
    if (!text || !element.checkVisibility({opacityProperty: true, visibilityProperty: true}))
      continue;
    if (element.closest("script, style, noscript, .q-icon, .disabled, [disabled], .skip"))
      continue;
    const box = element.getBoundingClientRect();
    if (!box.width || !box.height) continue;
    const drawn = element.closest("svg");
    const style = getComputedStyle(element);
    let alpha = 1;
    const grounds = [];
    for (let up = element; up; up = up.parentElement) {
      const own = getComputedStyle(up);
      alpha *= Number(own.opacity);
      const ground = parse(own.backgroundColor);
      if (ground[3] > 0 && !up.closest("svg")) grounds.push(ground);
      if (ground[3] === 1) break;
    }
    let below = [255, 255, 255, 1];
    for (const ground of grounds.reverse()) below = over(ground, below);
    const ink = parse(drawn && element.closest("text") ? style.fill : style.color);
    ink[3] *= alpha;
    const [a, b] = [light(over(ink, below)), light(below)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    seen += 1;
    if (ratio < (large ? LARGE : LEAST) - 0.01)
      found.push(`${ratio.toFixed(2)} ${text.slice(0, 40)} (${element.className})`.slice(0, 140));
  }
  return [seen, [...new Set(found)]];
}""".replace("LARGE", str(LEAST_LARGE)).replace("LEAST", str(LEAST))


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_text_of_all_pages_can_be_read(browser: Any, address: str, theme: str) -> None:
    faint = {}
    with visited(browser, address, color_scheme=theme) as page:
        dark = str(theme == "dark").lower()
        page.wait_for_function(f"document.body.classList.contains('body--dark') === {dark}")
        for tab in TABS:
            opened(page, tab)
            page.wait_for_timeout(300)
            for _ in range(SLOW // 100):  # a busy machine draws late
                seen_, found = page.evaluate(FAINT)
                if seen_ > 8:
                    break
                page.wait_for_timeout(100)
            assert seen_ > 8, tab
            if found:
                faint[tab] = found
    assert faint == {}


PICTURED = """() => [...document.querySelectorAll(".js-plotly-plot")]
  .filter((plot) => plot.checkVisibility() && plot._fullLayout)
  .map((plot) => [plot._fullLayout.font.color, plot._fullLayout.yaxis.gridcolor])"""


def test_all_pictures_follow_the_theme(browser: Any, address: str) -> None:
    wanted = [[colours(dark)[name] for name in ("ink", "grid")] for dark in (False, True)]
    drawn = f"wanted => ({PICTURED})().every((one) => `${{one}}` === `${{wanted}}`)"
    with visited(browser, address, color_scheme="light") as page:
        for tab in TABS:
            opened(page, tab)
            if tab in ("data", "look", "models"):
                page.wait_for_function(f"({PICTURED})().length > 0", timeout=SLOW)
        for tab in TABS:
            opened(page, tab)
            for theme in (True, False):
                seen(page, "theme").click()
                page.wait_for_function(drawn, arg=wanted[theme], timeout=SLOW)


NAMELESS = """() => {
  const own = (element) => {
    const by = element.getAttribute("aria-labelledby");
    const labels = [...(element.labels ?? [])].map((label) => label.innerText).join(" ");
    const text = element.matches("input, textarea, select") ? "" : [...element.childNodes].map(
      function told(node) {
        if (node.nodeType === 3) return node.textContent;
        if (node.nodeType !== 1 || node.getAttribute("aria-hidden") === "true") return "";
        return (node.getAttribute("aria-label") ?? "") + [...node.childNodes].map(told).join("");
      }).join("");
    return [element.getAttribute("aria-label"), by && document.getElementById(by)?.innerText,
      labels, text, element.title, element.getAttribute("placeholder")]
      .some((name) => name && name.trim());
  };
  const wanted = "button, a[href], input:not([type=hidden], [type=file]), textarea, select, "
    + "[role=button], [role=tab], [role=checkbox], [role=switch], [role=combobox]";
  return [...document.querySelectorAll(wanted)]
    .filter((element) => element.checkVisibility() && !element.closest("[aria-hidden=true]"))
    .filter((element) => !own(element)).map((element) => element.outerHTML.slice(0, 200));
}"""


def test_screen_readers_are_told_what_everything_is(browser: Any, address: str) -> None:
    with visited(browser, address) as page:
        assert page.get_by_role("banner").count() == 1
        assert page.get_by_role("main").count() == 1
        assert page.get_by_role("tablist", name="Steps").count() == 1
        assert page.get_by_role("heading", level=1).count() == 1
        assert page.get_by_role("tab", name="Take away").count() == 1
        nameless = {}
        for tab in TABS:
            opened(page, tab)
            assert page.get_by_role("tabpanel").count() >= 1
            with suppress(playwright.Error):  # names come a moment after what they name
                page.wait_for_function(f"() => ({NAMELESS})().length === 0", timeout=5000)
            found = page.evaluate(NAMELESS)
            if found:
                nameless[tab] = found
        assert nameless == {}, "\n".join(
            f"{tab}: {one}" for tab, all_ in nameless.items() for one in all_
        )


BROKEN = """() => {
  const broken = [];
  for (const cell of document.querySelectorAll(".q-table :is(td, th)")) {
    if (!cell.checkVisibility()) continue;
    const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    while (walker.nextNode())
      for (const word of walker.currentNode.textContent.matchAll(/[^\\s–-]+/g)) {
        const range = document.createRange();
        range.setStart(walker.currentNode, word.index);
        range.setEnd(walker.currentNode, word.index + word[0].length);
        if (range.getClientRects().length > 1) broken.push(word[0]);
      }
  }
  return broken;
}"""


def test_on_a_phone_words_of_tables_are_whole_and_tables_scroll(browser: Any, address: str) -> None:
    with visited(browser, address, viewport={"width": 400, "height": 800}) as page:
        opened(page, "look")
        seen(page, "characterization").locator("table").wait_for(timeout=SLOW)
        assert page.evaluate(BROKEN) == []
        opened(page, "models")
        page.locator("table td").first.wait_for(timeout=SLOW)
        assert page.evaluate(BROKEN) == []
        box = page.locator(".q-table__middle").first
        assert box.evaluate("one => one.scrollWidth > one.clientWidth && one.clientWidth < 400")


def test_buttons_and_names_of_a_picture_lie_beside_its_curves(browser: Any, address: str) -> None:
    boxes = "one => [...one.querySelectorAll('%s')].map((e) => e.getBoundingClientRect())"
    for width in (400, 1400):
        with visited(browser, address, viewport={"width": width, "height": 900}) as page:
            opened(page, "look")
            plot = seen(page, "loop-plot")
            plot.locator(".legend").wait_for(timeout=SLOW)
            page.wait_for_function("document.querySelector('.modebar-btn').tabIndex === -1")
            buttons = plot.evaluate(boxes % ".modebar-btn")
            (curves,) = plot.evaluate(boxes % ".cartesianlayer .gridlayer")
            (names,) = plot.evaluate(boxes % ".legend .bg")
            assert min(min(one["width"], one["height"]) for one in buttons) >= 24
            assert max(one["bottom"] for one in buttons) <= curves["top"]
            assert names["top"] >= curves["bottom"]


def test_the_phone_reaches_every_step(browser: Any, address: str) -> None:
    wide = {}
    size = {"width": 400, "height": 800}
    with visited(browser, address, viewport=size, has_touch=True, is_mobile=True) as page:
        for tab in TABS:
            box = seen(page, f"tab-{tab}").bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 400
            assert box["height"] >= 40
        for tab in TABS:
            opened(page, tab)
            width = page.evaluate("document.documentElement.scrollWidth")
            if width > 400:
                wide[tab] = width
        assert wide == {}
        opened(page, "data")
        seen(page, "rig").click()
        box = page.get_by_role("dialog").locator(".q-card").first.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 400


def test_the_keyboard_skips_to_the_content_and_sees_where_it_is(browser: Any, address: str) -> None:
    with visited(browser, address, reduced_motion="reduce") as page:
        idle(page)
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.innerText") == "Skip to the content"
        assert page.evaluate("document.activeElement.getBoundingClientRect().x") >= 0
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "content"
        seen(page, "tab-data").focus()
        page.keyboard.press("ArrowRight")
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert page.evaluate(outline) != "none"
        moves = "getComputedStyle(document.querySelector('.q-btn')).transitionProperty"
        assert page.evaluate(moves) == "none"


def test_what_cannot_be_pressed_is_plainly_lighter(browser: Any, address: str) -> None:
    with visited(browser, address) as page:
        seen(page, "recording-run").scroll_into_view_if_needed()
        redo = seen(page, "redo")
        assert redo.is_disabled()
        assert redo.evaluate("one => Number(getComputedStyle(one).opacity)") <= 0.4
        subtitles = page.locator("[data-testid=upload] .q-uploader__subtitle")
        assert subtitles.count() == 1
        assert not subtitles.first.is_visible()
