"""`uavdepth watch`: scan and status of vehicles, live in a terminal."""
