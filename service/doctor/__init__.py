"""`uavdepth doctor`: why nothing would show or stop, in plain words, each with the fix."""
