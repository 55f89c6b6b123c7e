"""The face of the package: what is here can be had from it, and is imported when it is first used."""

from . import muscles as muscles
from .blocks.bands.banded import Banded as Banded
from .blocks.compose import Parallel as Parallel
from .blocks.compose import PerChannel as PerChannel
from .blocks.compose import Series as Series
from .blocks.core.block import Block as Block
from .blocks.core.fields import Channel as Channel
from .blocks.core.saving import load as load
from .blocks.laws.check import check_block as check_block
from .blocks.memoryless.affine import Affine as Affine
from .blocks.memoryless.piecewise_linear import PiecewiseLinear as PiecewiseLinear
from .blocks.memoryless.polynomial import Polynomial as Polynomial
from .blocks.play_type.eupi import EUPI as EUPI
from .blocks.play_type.gpi import GPI as GPI
from .blocks.play_type.pi import PI as PI
from .blocks.play_type.play import Play as Play
from .blocks.play_type.rate_dependent_pi import RateDependentPI as RateDependentPI
from .characterization import characterize as characterize
from .comparison.calibrating import calibrate as calibrate
from .comparison.orders import identify as identify
from .comparison.ranking import compare as compare
from .errors import DataError as DataError
from .errors import DataWarning as DataWarning
from .errors import MckibbenError as MckibbenError
from .errors import ModelError as ModelError
from .errors import ModelWarning as ModelWarning
from .estimators.play_type.eupi import EUPIEstimator as EUPIEstimator
from .estimators.play_type.gpi import GPIEstimator as GPIEstimator
from .estimators.play_type.mpi import MPIEstimator as MPIEstimator
from .estimators.play_type.pi import PIEstimator as PIEstimator
from .estimators.play_type.rdpi import RDPIEstimator as RDPIEstimator
from .excitation.planning import plan as plan
from .excitation.telling import untold as untold
from .files import read as read
from .files import write as write
from .recording import Recording as Recording
from .report import write_report as write_report
from .rigs import Rig as Rig
from .rigs import check_rig as check_rig
from .rigs import load_rig as load_rig
from .studying.reviewing import review as review
from .studying.study import study as study
from .validation.check import check as check
from .version import __version__ as __version__

__all__: list[str]
