"""Metres for networks that have none of their own."""
