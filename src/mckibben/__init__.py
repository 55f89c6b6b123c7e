"""Hysteresis of pneumatic artificial muscles: recordings, models, inverses.

The names in ``__init__.pyi`` are imported when they are first used: ``import mckibben`` is quick.

>>> import mckibben
>>> model = mckibben.PI(thresholds=(0.0, 0.5), weights=(3.0, 1.0))
>>> model.simulate([0.0, 2.0, 1.0]).tolist()
[-0.5, 7.5, 4.5]
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
