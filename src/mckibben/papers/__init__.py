"""Re-runs of the papers: their protocol on their rig, their methods as published beside our best."""

from mckibben.papers.reproduction import Figure, Reproduction, Table, reproduce

__all__ = ["Figure", "Reproduction", "Table", "reproduce"]
