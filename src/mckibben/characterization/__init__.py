"""What a muscle does, in numbers and words, from recordings alone."""

from mckibben.characterization.characterizing import characterize as characterize
from mckibben.characterization.loops import Cycle as Cycle
from mckibben.characterization.results import Characterization as Characterization
