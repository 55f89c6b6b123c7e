"""Envelopes of generalised play operators: strictly increasing functions of the input.

One file each: two kernels, ``value`` and ``inverse``, and the frozen class that names their
parameters. Adding one is a file here, its test, and one line in the registry.
"""

from __future__ import annotations

from mckibben.blocks.hysteresis.envelopes.base import Envelope

__all__ = ["Envelope"]
