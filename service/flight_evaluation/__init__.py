"""What the distances are worth in flight: rendered flights against exact truth, open and closed loop."""
