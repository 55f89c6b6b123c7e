"""Virtual rigs: physics, independent of the models fitted to it."""

from mckibben import hints
from mckibben.rigs.files import describe as describe
from mckibben.rigs.files import rig_names as rig_names
from mckibben.rigs.recording import record as record
from mckibben.rigs.recording import share as share
from mckibben.rigs.rig import Rig as Rig
from mckibben.rigs.rig import load_rig as load_rig
from mckibben.rigs.rig import save_rig as save_rig

hints.lead_on(__name__)
