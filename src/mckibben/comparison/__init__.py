"""Models chosen and tested on recordings: splits, scores, intervals, memory test, the whole study."""
