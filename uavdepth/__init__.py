"""Monocular obstacle awareness for drones: the perception library."""
