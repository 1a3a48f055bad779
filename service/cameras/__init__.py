"""Cameras: one abstract camera, one file a backend, a background reader that keeps the newest picture."""
