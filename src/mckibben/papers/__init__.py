"""The papers, one folder each: protocol, printed results, and re-run."""

from mckibben import hints

hints.lead_on(__name__)
