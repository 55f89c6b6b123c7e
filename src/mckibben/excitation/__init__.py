"""What recordings can and cannot tell, and what to record next."""

from mckibben.excitation.gap import Gap as Gap
from mckibben.excitation.telling import untold as untold
