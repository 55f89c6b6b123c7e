"""Characterization and checks of recordings and models, as numbers with intervals."""

from mckibben.diagnosis.characterization import Characterization as Characterization
from mckibben.diagnosis.characterization import characterize as characterize
from mckibben.diagnosis.loops import Cycle as Cycle
