"""Regenerates what the five publications print, and lays it beside them."""
