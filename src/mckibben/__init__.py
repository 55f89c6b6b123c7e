"""Hysteresis of pneumatic artificial muscles: recordings, models, inverses.

The names in ``__init__.pyi`` are imported when they are first used: ``import mckibben`` is quick.

>>> import mckibben
>>> model = mckibben.PI(thresholds=(0.0, 0.5), weights=(3.0, 1.0))
>>> model.simulate([0.0, 2.0, 1.0]).tolist()
[-0.5, 7.5, 4.5]
"""

from __future__ import annotations

from typing import Any

import lazy_loader

from mckibben.hints import absent

_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Import a name when it is first used, or raise an error that leads to what there is instead."""
    if name not in __all__:
        raise AttributeError(absent("mckibben", name, __all__, "mckibben"), name=name)
    return _attached(name)
