"""Real-time loops in Python: a fixed rate with deadline statistics."""

from __future__ import annotations

from mckibben import hints
from mckibben.stream.fixed_rate import Deadlines as Deadlines
from mckibben.stream.fixed_rate import FixedRate as FixedRate
from mckibben.stream.stepping import Step as Step
from mckibben.stream.stepping import run as run

hints.lead_on(__name__)
