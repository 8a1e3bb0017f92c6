"""For learning: the walk as an environment, an expert to imitate, reference motions."""
