"""Reproduces the figures and numbers of five publications and compares them with the printed ones."""
