"""The demo: a fake autopilot, a rendered city and the same service that flies on a vehicle."""
