"""Depth of a picture: the values, how they are sent, and how they are shown."""
