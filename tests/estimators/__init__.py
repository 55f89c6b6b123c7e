"""Laws of identification: a model of the estimator's own kind is found again from its recordings.

Derivatives are exact; settings and data that cannot be are refused by name.
"""
