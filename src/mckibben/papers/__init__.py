"""The papers, one folder each: protocol, printed results, and re-run."""

from mckibben.hints import lead_on

lead_on(__name__)
