"""Driving an exported model on a microcontroller from Python, over a serial line."""

from __future__ import annotations

from mckibben import hints
from mckibben.link.client import Device as Device
from mckibben.link.client import Link as Link
from mckibben.link.client import LinkError as LinkError
from mckibben.link.client import Note as Note
from mckibben.link.client import Port as Port
from mckibben.link.client import State as State
from mckibben.link.client import Statistics as Statistics

hints.lead_on(__name__)
