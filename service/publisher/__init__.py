"""Zenoh: what leaves towards the ground station, and how it is written."""
