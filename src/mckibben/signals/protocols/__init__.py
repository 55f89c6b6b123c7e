"""The papers' experiments, run by run."""

from mckibben.signals.protocols.protocol import Protocol as Protocol
from mckibben.signals.protocols.protocol import Run as Run
from mckibben.signals.protocols.protocol import protocol as protocol
