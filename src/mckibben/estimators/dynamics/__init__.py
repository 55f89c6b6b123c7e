"""Estimators of dynamics before or after the muscle."""
