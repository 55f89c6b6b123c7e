"""Signals: turning points, branches and cycles; cutting, resampling, thinning; excitations."""

from mckibben.signals.excitations import irregular_triangle as irregular_triangle
from mckibben.signals.excitations import random_wave as random_wave
from mckibben.signals.excitations import sine as sine
from mckibben.signals.excitations import staircase as staircase
from mckibben.signals.excitations import triangle as triangle
from mckibben.signals.resampling import cut as cut
from mckibben.signals.resampling import resample as resample
from mckibben.signals.reversals import branches as branches
from mckibben.signals.reversals import cycles as cycles
from mckibben.signals.reversals import noise_level as noise_level
from mckibben.signals.reversals import reversals as reversals
from mckibben.signals.splitting import branches_of as branches_of
from mckibben.signals.splitting import split_cycles as split_cycles
from mckibben.signals.splitting import split_time as split_time
from mckibben.signals.thinning import decimate_minmax as decimate_minmax
