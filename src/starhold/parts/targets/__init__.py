"""Targets: attitudes to reach, one per file."""
