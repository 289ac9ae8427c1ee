"""Actuators: the path from the command to the applied torque, one per file."""
