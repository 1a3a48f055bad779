"""The depth network: light encoder, feature aggregation nodes, decoder with channel attention."""
