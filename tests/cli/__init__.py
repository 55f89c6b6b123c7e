"""Laws of commands: code 0, or code 2 with a remedy and nothing written; no input is overwritten.

Any name of a file is read and printed, and an interrupt keeps what is finished.
"""
