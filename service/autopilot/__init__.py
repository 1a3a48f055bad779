"""The autopilot link: endpoints, the MAVLink conversation, and the thread round it."""
