"""Guesses of the evidence that the kernel needs. Nothing here is trusted."""
