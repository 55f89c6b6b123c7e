"""Signals: turning points, branches, cycles; cutting, filtering, resampling, thinning; excitations."""

from mckibben import hints
from mckibben.signals.broadband import chirp as chirp
from mckibben.signals.broadband import multisine as multisine
from mckibben.signals.broadband import random_wave as random_wave
from mckibben.signals.coarsening import coarsened as coarsened
from mckibben.signals.coarsening import made_manageable as made_manageable
from mckibben.signals.excitations import decaying_sine as decaying_sine
from mckibben.signals.excitations import decaying_triangle as decaying_triangle
from mckibben.signals.excitations import irregular_triangle as irregular_triangle
from mckibben.signals.excitations import progressive_sine as progressive_sine
from mckibben.signals.excitations import progressive_triangle as progressive_triangle
from mckibben.signals.excitations import sine as sine
from mckibben.signals.excitations import triangle as triangle
from mckibben.signals.filtering import detrend as detrend
from mckibben.signals.filtering import low_pass as low_pass
from mckibben.signals.loads import constant as constant
from mckibben.signals.loads import pulls as pulls
from mckibben.signals.loads import ramps as ramps
from mckibben.signals.naming import build as build
from mckibben.signals.naming import settings_of as settings_of
from mckibben.signals.resampling import cut as cut
from mckibben.signals.resampling import resample as resample
from mckibben.signals.reversals import branches as branches
from mckibben.signals.reversals import cycles as cycles
from mckibben.signals.reversals import noise_level as noise_level
from mckibben.signals.reversals import reversals as reversals
from mckibben.signals.splitting import split_cycles as split_cycles
from mckibben.signals.steps import binary_steps as binary_steps
from mckibben.signals.steps import staircase as staircase
from mckibben.signals.thinning import decimate_minmax as decimate_minmax
from mckibben.signals.zeroing import zeroed as zeroed

hints.lead_on(__name__)
