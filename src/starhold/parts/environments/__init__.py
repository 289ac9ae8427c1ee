"""Environments: torques, forces and fields around the craft, one per file."""
