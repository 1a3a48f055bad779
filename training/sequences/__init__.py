"""Frames in the order they were taken: readers of recordings and data sets, triplets, batches of triplets."""
