"""Model comparison on recordings: splits, scores, intervals, memory test, and whole studies."""
