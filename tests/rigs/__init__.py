"""Laws of virtual rigs: they keep to physics, repeat by seed, saturate and say so."""
