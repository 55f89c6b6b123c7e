"""Laws of plans: within limits, at rest at both ends, and with what the recordings lack."""
