"""How the workbench looks: colours of both themes in one place, the phone, the keyboard, less motion."""

from __future__ import annotations

from types import MappingProxyType

LIGHT = MappingProxyType(
    {
        "paper": "#ffffff",
        "tint": "#f4f6f8",
        "ink": "#1c2024",
        "muted": "#5c656e",
        "bar": "#005a8c",
        "on-bar": "#ffffff",
        "on": "#ffffff",
        "primary": "#0072b2",
        "secondary": "#4a5560",
        "accent": "#7e03a8",
        "positive": "#1b7a3d",
        "negative": "#b3261e",
        "info": "#0b6e8f",
        "warning": "#9a4a00",
    }
)
"""Colours by what they are for; ``on`` is written on the last seven."""

DARK = MappingProxyType(
    {
        "paper": "#15181b",
        "tint": "#1d2125",
        "ink": "#e4e7ea",
        "muted": "#9aa4ae",
        "bar": "#1d2125",
        "on-bar": "#e4e7ea",
        "on": "#10161b",
        "primary": "#56b4e9",
        "secondary": "#b4bec8",
        "accent": "#d9a3f0",
        "positive": "#5fcf86",
        "negative": "#ff9a8f",
        "info": "#6cc6e0",
        "warning": "#f0a35c",
    }
)

BRANDS = ("primary", "secondary", "accent", "positive", "negative", "info", "warning")
"""Colours that text has, and that buttons and messages are filled with."""

WRITTEN = (
    *((text, ground) for text in ("ink", "muted", *BRANDS) for ground in ("paper", "tint")),
    ("on-bar", "bar"),
    *(("on", brand) for brand in BRANDS),
)
"""Text, and what it stands on, wherever that happens."""


def contrast(one: str, other: str) -> float:
    """Return the contrast of two colours as WCAG 2 defines it, from 1 to 21."""
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    parts = (int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5))
    linear = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def style() -> str:
    """Return the style sheet."""
    filled = ", ".join(f".bg-{brand}" for brand in BRANDS)
    return f"""
body {{ {_variables(LIGHT)} }}
body.body--dark {{ {_variables(DARK)} }}
@layer overrides {{
  {filled} {{ color: var(--on) !important }}
  :is({filled}) :is(.text-white, .text-black) {{ color: var(--on) !important }}
  .bar {{ background: var(--bar) !important; color: var(--on-bar) !important }}
  .q-uploader__header {{ color: var(--on) !important }}
  .q-notification :is(.q-notification__actions, .q-btn) {{ color: inherit !important }}
  .q-uploader:not(:has(.q-uploader__list > *)) .q-uploader__subtitle {{ display: none }}
  .q-btn--flat.disabled {{ color: var(--muted) !important; opacity: 0.35 !important }}
  .text-grey, .q-table__bottom {{ color: var(--muted) !important }}
}}
{SHEET}"""


def _variables(colours: MappingProxyType[str, str]) -> str:
    named = [f"--q-{brand}: {colours[brand]} !important" for brand in BRANDS]
    named += [f"--{name}: {colour}" for name, colour in colours.items() if name not in BRANDS]
    named += [f"--q-dark-page: {DARK['paper']} !important", f"--q-dark: {DARK['tint']} !important"]
    return "; ".join(named)


SHEET = """
body { background: var(--paper); color: var(--ink) }
:focus-visible, .q-focusable:focus-visible, .q-tab:focus-visible {
  outline: 3px solid var(--q-primary); outline-offset: 2px;
}
.bar :focus-visible { outline-color: var(--on-bar); outline-offset: -3px }
.q-tab--inactive { opacity: 1 }
.q-btn, .q-tab { text-transform: none }
.skip { position: fixed; left: -99rem; top: 0; z-index: 9999; padding: .6rem 1rem;
  background: var(--paper); color: var(--q-primary); text-decoration: underline }
.skip:focus { left: 0 }
.nicegui-content { padding: .5rem 1rem }
.q-dialog__inner > .q-card { max-width: min(56rem, 94vw); max-height: 92vh; overflow: auto }
.q-table__container, .q-uploader { max-width: 100% }
/* a shade at the right edge, which the end of what scrolls covers, says that there is more */
.q-table__middle { --ground: #fff;
  background: linear-gradient(270deg, var(--ground) 2rem, transparent 3rem) local,
    linear-gradient(270deg, var(--muted), transparent .4rem) scroll }
.body--dark .q-table__middle { --ground: var(--tint) }
.modebar-btn { min-width: 24px; min-height: 24px }
.nicegui-content label, .nicegui-content .q-item__label { overflow-wrap: anywhere }
.q-select .q-field__native > .ellipsis { white-space: normal }
#asked { position: fixed; left: 0; top: 0; width: 100%; height: 4px; z-index: 9999;
  background: var(--q-warning); opacity: 0; pointer-events: none; transform-origin: left }
#asked.on { opacity: 1; animation: asked 1.2s ease-in-out infinite }
@keyframes asked { from { transform: scaleX(0) } to { transform: scaleX(1) } }
@media (max-width: 699px) {
  .bar .tabs { order: 9; width: 100% }
  .bar .tabs .q-tabs__content { width: 100% }
  .bar .tabs .q-tab { flex: 1 1 0; min-width: 0; padding: 0 2px; min-height: 52px }
  .bar .tabs .q-tabs__arrow { display: none !important }
  .bar .tabs .q-tab__content { flex-direction: column; min-width: 0 }
  .bar .tabs .q-tab__label { font-size: 12px; margin: 2px 0 0; line-height: 1.2; overflow: visible }
  .nicegui-content, .q-tab-panel { padding: .25rem }
  .nicegui-content > *, .nicegui-column, .nicegui-row { max-width: 100% }
  .nicegui-content [class*="min-w-"] { min-width: min(100%, 12rem) }
  .nicegui-content .q-btn { min-height: 40px }
  .q-table td.text-left { white-space: normal; overflow-wrap: normal; min-width: 7rem }
  .q-table th, .q-table td { padding: 4px 6px }
  .q-dialog__inner { padding: 8px }
}
@media (prefers-reduced-motion: reduce) {
  *, *::before, *::after {
    animation-duration: .01ms !important; animation-iteration-count: 1 !important;
    transition: none !important; scroll-behavior: auto !important;
  }
  #asked.on { animation: none }
}
"""

SCRIPT = """
// what the frame's parts do not say to screen readers
const name = (element, text) => {
  if (!element.getAttribute("aria-label")) element.setAttribute("aria-label", text);
};
let naming = 0;
const nameAll = () => {
  naming = 0;
  document.querySelectorAll(".modebar-btn").forEach((one) => { one.tabIndex = -1 });
  document.querySelectorAll(".q-uploader a.q-btn").forEach((add) => name(add, "Choose files"));
  document.querySelectorAll(".q-table thead .q-checkbox").forEach((all) => name(all, "All rows"));
  document.querySelectorAll(".q-table tbody .q-checkbox").forEach((one) =>
    name(one, "Row " + (one.closest("tr")?.innerText.trim().split(/[\\t\\n]/)[0] ?? "")));
};
new MutationObserver(() => { naming ||= setTimeout(nameAll, 200) })
  .observe(document.documentElement, {childList: true, subtree: true});
addEventListener("unhandledrejection", (event) => {
  // a figure on a page that is not shown cannot be resized, and need not be
  if (String(event.reason).includes("displayed plot div")) event.preventDefault();
});
addEventListener("click", (event) => {
  const button = event.target.closest?.("button, [role=tab], [role=option], [role=switch]");
  if (!button) return;
  if (event.detail > 1 && button.matches(".q-btn") && !button.closest("[data-repeat]")) {
    event.stopImmediatePropagation();  // a double click is one click
    event.preventDefault();
    return;
  }
  // who was clicked has asked; until the server is free to answer, that is shown
  const bar = document.getElementById("asked");
  const shown = setTimeout(() => bar?.classList.add("on"), 120);
  fetch("awake", {cache: "no-store"}).catch(() => {}).finally(() => {
    clearTimeout(shown);
    bar?.classList.remove("on");
  });
}, true);
"""
