"""Hysteresis of pneumatic artificial muscles: recordings, models, inverses.

The names below are imported when they are first used, so that ``import mckibben`` is quick.

>>> import mckibben
>>> model = mckibben.PI(thresholds=(0.0, 0.5), weights=(3.0, 1.0))
>>> model.simulate([0.0, 2.0, 1.0]).tolist()
[-0.5, 7.5, 4.5]
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mckibben.errors import DataError, DataWarning, MckibbenError, ModelError, ModelWarning

if TYPE_CHECKING:
    from mckibben.blocks.affine import Affine as Affine
    from mckibben.blocks.base import Block as Block
    from mckibben.blocks.check import check_block as check_block
    from mckibben.blocks.compose import Parallel as Parallel
    from mckibben.blocks.compose import PerChannel as PerChannel
    from mckibben.blocks.compose import Series as Series
    from mckibben.blocks.eupi import EUPI as EUPI
    from mckibben.blocks.fields import Channel as Channel
    from mckibben.blocks.gpi import GPI as GPI
    from mckibben.blocks.pi import PI as PI
    from mckibben.blocks.piecewise_linear import PiecewiseLinear as PiecewiseLinear
    from mckibben.blocks.play import Play as Play
    from mckibben.blocks.polynomial import Polynomial as Polynomial
    from mckibben.blocks.rate_dependent_pi import RateDependentPI as RateDependentPI
    from mckibben.blocks.saving import load as load
    from mckibben.characterization import characterize as characterize
    from mckibben.comparison.orders import identify as identify
    from mckibben.comparison.ranking import compare as compare
    from mckibben.comparison.studying import study as study
    from mckibben.estimators.eupi import EUPIEstimator as EUPIEstimator
    from mckibben.estimators.gpi import GPIEstimator as GPIEstimator
    from mckibben.estimators.mpi import MPIEstimator as MPIEstimator
    from mckibben.estimators.pi import PIEstimator as PIEstimator
    from mckibben.estimators.rdpi import RDPIEstimator as RDPIEstimator
    from mckibben.files import read as read
    from mckibben.files import write as write
    from mckibben.recording import Recording as Recording
    from mckibben.report import write_report as write_report
    from mckibben.rigs import Rig as Rig
    from mckibben.rigs import check_rig as check_rig
    from mckibben.rigs import load_rig as load_rig

    __version__: str

_HOMES = {
    "Affine": "blocks.affine",
    "Block": "blocks.base",
    "Channel": "blocks.base",
    "EUPI": "blocks.eupi",
    "EUPIEstimator": "estimators.eupi",
    "GPI": "blocks.gpi",
    "GPIEstimator": "estimators.gpi",
    "MPIEstimator": "estimators.mpi",
    "PI": "blocks.pi",
    "PIEstimator": "estimators.pi",
    "Parallel": "blocks.compose",
    "PerChannel": "blocks.compose",
    "PiecewiseLinear": "blocks.piecewise_linear",
    "Play": "blocks.play",
    "Polynomial": "blocks.polynomial",
    "RDPIEstimator": "estimators.rdpi",
    "RateDependentPI": "blocks.rate_dependent_pi",
    "Recording": "recording",
    "Series": "blocks.compose",
    "Rig": "rigs",
    "characterize": "characterization",
    "check_block": "blocks.check",
    "check_rig": "rigs",
    "compare": "comparison.ranking",
    "identify": "comparison.orders",
    "load": "blocks.saving",
    "load_rig": "rigs",
    "read": "files",
    "study": "comparison.studying",
    "write": "files",
    "write_report": "report",
}

__all__ = [  # the names of _HOMES are resolved by __getattr__
    "DataError",
    "DataWarning",
    "MckibbenError",
    "ModelError",
    "ModelWarning",
    "__version__",
    *_HOMES,
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("mckibben")
    if name not in _HOMES:
        raise AttributeError(f"module 'mckibben' has no attribute {name!r}")
    return getattr(import_module(f"mckibben.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
