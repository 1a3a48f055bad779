"""Training from video alone: a depth and a pose network taught by re-projection."""
