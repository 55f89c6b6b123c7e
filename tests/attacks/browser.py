"""A browser in which everything that would leave the machine is caught and named.

No name of a host is found in it, and every request of the page and every window that it opens is noted;
what the browser asks its maker is not the page's. `click_everything` does what a curious reader does.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from shutil import which
from typing import Any
from urllib.parse import urlsplit

import pytest

OPTIONS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]

PROBE = "ran-what-it-should-not"
"""What hostile names set on the window if a browser runs them."""

HOSTILE = (
    f"</script><script>window['{PROBE}']=1</script>"
    f"<img src=x onerror=\"window['{PROBE}']=2\">"
    f"<a href=\"javascript:window['{PROBE}']=3\">press</a>"
    "<a href='https://cloud.example/press'>press</a>"
)
"""A name that runs a script, or leads elsewhere, wherever it is taken for markup."""

RUN = f"window['{PROBE}']=1"

SCRIPTS = (
    f'" :x="{RUN}" onclick="{RUN}',
    f'x\' :data-y="{RUN}"',
    f"<img src=x onerror={RUN}>",
    f'```\n<script>{RUN}</script>\n<a href="javascript:{RUN}">click</a>\n```',
    f'`${{{RUN}}}` {{{{ constructor.constructor("{RUN}")() }}}}',
    f'<svg onload="{RUN}"></svg>',
    HOSTILE,
)
"""Names and notes that run a script wherever a page takes them for code."""

CLICKABLE = (
    "button, summary, select, input, label, a:not([href^='http']), [role=button], .modebar-btn,"
    " .legendtoggle, .plot a, [class*=dialog] *"
)

CLICK = """async (which) => {
    const seen = (window.clickedBefore ??= new WeakSet());
    const all = [...document.querySelectorAll(which)].filter((e) => !seen.has(e));
    for (const e of all) {
        seen.add(e);
        if (!e.isConnected) continue;
        for (const kind of ["mousedown", "mouseup", "click"])
            e.dispatchEvent(new MouseEvent(kind, {bubbles: true, cancelable: true}));
        await new Promise((next) => setTimeout(next));
    }
    return all.length;
}"""

WINDOWS = """window.windowsOpened = [];
window.open = (address) => { window.windowsOpened.push(`${address}`); return window; };"""
"""A browser opens windows for people alone."""


@dataclass
class Watched:
    """A page, the addresses that left it, and what it complained of: a stopped script is one."""

    page: Any
    left: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def click_everything(self, which: str = CLICKABLE) -> int:
        """Click whatever can be clicked, and what that opens; return how many clicks it took."""
        clicks = 0
        for _ in range(3):  # what the first clicks open is clicked next
            clicks += int(self.page.evaluate(CLICK, which))
            self.page.wait_for_timeout(300)
        self.left += self.page.evaluate("window.windowsOpened.splice(0)")
        return clicks

    def unharmed(self) -> None:
        """Assert that nothing left, and that no name was run."""
        ran = self.page.evaluate(f"window['{PROBE}'] ?? null")
        assert (ran, self.left, self.errors) == (None, [], [])


@contextmanager
def watched(own: str) -> Iterator[Watched]:
    """Open a page of this machine, a file or of a server here, where nothing else is reached."""
    play_with = pytest.importorskip("playwright.sync_api").sync_playwright
    with play_with() as play:
        browser = play.chromium.launch(executable_path=which("chromium"), args=OPTIONS)
        parts = urlsplit(own)
        ours = own if parts.scheme == "file" else f"{parts.scheme}://{parts.netloc}/"
        here = ours.replace("http", "ws", 1)
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        found = Watched(context.new_page())

        def asked(url: str, allowed: tuple[str, ...]) -> None:
            if not url.startswith(allowed):
                found.left.append(url)

        page = found.page
        context.on("request", lambda request: asked(request.url, (ours, "data:", "blob:")))
        context.add_init_script(WINDOWS)
        page.on("websocket", lambda link: asked(link.url, (here,)))
        page.on("console", lambda m: found.errors.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: found.errors.append(str(error)))
        page.goto(own)
        try:
            yield found
        finally:
            browser.close()
