"""Laws of all blocks, all estimators and the whole project, over everything that is registered."""
