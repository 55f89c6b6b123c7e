"""Every sentence about results: each is made from the numbers of a result, which stand beside it.

Library functions return numbers. Whatever says something about them to a person is here, in one section
a room, so that all of it can be read, counted and tested on plants where it is false.
"""

from __future__ import annotations

# --- Comparison -------------------------------------------------------------------------------------

# --- What the muscle does ---------------------------------------------------------------------------

# --- Residual check ---------------------------------------------------------------------------------

# --- Data gaps and plans ----------------------------------------------------------------------------

# --- Bands and log reviews --------------------------------------------------------------------------

# --- The three answers ------------------------------------------------------------------------------
