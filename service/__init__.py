"""The program that flies: cameras, autopilot link, Zenoh, configuration, command line."""
