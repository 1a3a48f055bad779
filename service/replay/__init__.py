"""Replay: recorded flights measured again by the same pipeline, on the record's clock."""
