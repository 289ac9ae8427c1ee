"""A plant to which flight software connects: one protocol, over a network, a serial line or pipes."""
