"""Laws of leaderboards: errors are of free runs on data not fitted, and the test has no say.

What noise gives or what ran away is not recommended; any executor gives the same rows.
"""
