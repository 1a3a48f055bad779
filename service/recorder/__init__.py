"""The recorder: what the service saw, heard and said, as MCAP files for Foxglove and Rerun."""
