"""Flights and metrics of the bodies that have a study of their own."""
