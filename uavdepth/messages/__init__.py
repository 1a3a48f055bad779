"""Scans as the autopilots' messages."""
