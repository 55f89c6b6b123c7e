"""The wire: an exported model on a microcontroller, led from Python over a serial line.

The protocol is described in docs/deploy/link.md; the other end is C99 that was
exported with ``link``.
"""

from __future__ import annotations

from mckibben.link.client import Link as Link
from mckibben.link.device import Device as Device
from mckibben.link.device import Port as Port
from mckibben.link.device import State as State
from mckibben.link.exchange import LinkError as LinkError
from mckibben.link.exchange import Statistics as Statistics
from mckibben.link.ports import ByteStream as ByteStream
from mckibben.link.ports import Descriptor as Descriptor
from mckibben.link.ports import open_port as open_port
