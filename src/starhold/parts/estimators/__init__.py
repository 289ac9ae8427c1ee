"""Estimators of the body's state, one file each."""
