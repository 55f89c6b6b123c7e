"""The physics that virtual rigs are made of: muscles, compressed air, and what they move.

Inside, lengths are in mm, forces in N, times in s, masses in t (so that N = t mm/s²), and pressures in
bar above the atmosphere; 1 bar mm² is 0.1 N.
"""
