"""Models ranked on recordings: splits, scores, intervals, the memory test, the whole study."""
