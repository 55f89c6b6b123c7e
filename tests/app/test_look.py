"""Colours of both themes: text can be read."""

from __future__ import annotations

import pytest

pytest.importorskip("nicegui")

from mckibben.app.widgets import colours

GROUNDS = {False: ("#ffffff", "#f4f6f8"), True: ("#1d2125", "#15181b", "#262b31")}
"""Cards, pages and chosen rows, as in ``style.css``."""


def luminance(colour: str) -> float:
    parts = (int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
    linear = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("text", ["ink", "muted", "accent", "warn"])
def test_contrast_is_that_of_aa(text: str, dark: bool) -> None:
    for ground in GROUNDS[dark]:
        low, high = sorted(map(luminance, (colours(dark)[text], ground)))
        assert (high + 0.05) / (low + 0.05) >= 4.5
