"""Estimators of what lies before the muscle, or follows it: blocks with times of their own."""
