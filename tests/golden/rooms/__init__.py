"""Cases by room: a file here that has a function ``cases`` gives them."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from tests.golden.case import Case


@cache
def all_cases() -> dict[str, Case]:
    """Return every case by its name."""
    found: dict[str, Case] = {}
    for module in pkgutil.iter_modules(__path__):
        for case in importlib.import_module(f"{__name__}.{module.name}").cases():
            if case.name in found:
                raise ValueError(f"two cases are called {case.name}")
            found[case.name] = case
    return found
