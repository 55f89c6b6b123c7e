"""Laws of judgement: what is right is found right, and what is wrong is told, on data of known truth.

Intervals hold the truth as often as they say; units, zeros and other inputs change no verdict.
"""
