"""Points of known depth from the vehicle's own motion."""
