"""Scenarios of the second kind: keeping a craft near a libration point."""
