"""Physics of virtual rigs: muscles, compressed air, and mechanisms.

Inside, lengths are in mm, forces in N, times in s, masses in t (so that N = t mm/s²), and pressures in
bar above the atmosphere; 1 bar mm² is 0.1 N.
"""
