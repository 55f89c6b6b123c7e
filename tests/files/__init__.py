"""Laws of reading: a file is read rightly, or refused by file, channel and row with a remedy that works.

Units and times are never guessed silently; what is written is read back equal.
"""
