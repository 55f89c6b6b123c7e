"""Virtual rigs: physics, independent of the models fitted to it."""

from mckibben.rigs.check import check_rig as check_rig
from mckibben.rigs.data_sheet import rig_from_data_sheet as rig_from_data_sheet
from mckibben.rigs.files import describe as describe
from mckibben.rigs.files import load_rig as load_rig
from mckibben.rigs.files import rig_names as rig_names
from mckibben.rigs.files import save_rig as save_rig
from mckibben.rigs.recording import record as record
from mckibben.rigs.rig import Rig as Rig
