"""Sensors: readings of the state, one per file."""
