"""Pages on what paper A leaves open, in its Section 6: python docs/papers/beyond.py [PAGE ...].

Frequency and load (rates-and-loads, about 15 minutes), and arms of several sections (two-sections,
about 20 minutes).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import rates_and_loads
import two_sections

PAGES: Mapping[str, Callable[[], str]] = {
    "rates-and-loads": rates_and_loads.page,
    "two-sections": two_sections.page,
}


def main() -> None:
    """Make the pages named, or all."""
    for name in sys.argv[1:] or PAGES:
        text = PAGES[name]()
        (Path(__file__).parent / f"{name}.md").write_text(text, encoding="utf-8")
        print(text)


if __name__ == "__main__":
    main()
