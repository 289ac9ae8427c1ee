"""Effectors: mechanisms with a state of their own and a reaction on the body, one per file."""
