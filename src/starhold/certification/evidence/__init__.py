"""Guesses of the evidence that the kernel asks for. Nothing here is trusted."""
