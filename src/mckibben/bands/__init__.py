"""Bands that hold: how far a model may be off on a new run, found on runs that it was not fitted to.

Conformal prediction: what a model missed on some runs bounds what it misses on the next, if all are
exchangeable, whatever the model and its errors are. A miss counts in units of a scale that follows the
state of motion, so that the band is wide where the model is bad.
"""
