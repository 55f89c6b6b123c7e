"""Controllers, and closed loops on rigs and models."""

from mckibben import hints
from mckibben.control.controller import BlockController as BlockController
from mckibben.control.controller import Controller as Controller
from mckibben.control.controller import DisturbanceObserver as DisturbanceObserver
from mckibben.control.controller import EstimatedLoad as EstimatedLoad
from mckibben.control.controller import preview_time as preview_time
from mckibben.control.controller import previewed as previewed
from mckibben.control.iterative_learning import Learned as Learned
from mckibben.control.iterative_learning import learn as learn
from mckibben.control.iterative_learning import learned as learned
from mckibben.control.laws import control_law as control_law
from mckibben.control.loop import Tracked as Tracked
from mckibben.control.loop import track as track
from mckibben.control.tuning import tune_pid as tune_pid
from mckibben.control.twin import Twin as Twin
from mckibben.control.uncompensated import UNCOMPENSATED as UNCOMPENSATED
from mckibben.control.uncompensated import Before as Before
from mckibben.control.uncompensated import before as before
from mckibben.control.uncompensated import slow_cycle as slow_cycle
from mckibben.control.uncompensated import uncompensated as uncompensated

hints.lead_on(__name__)
