"""A plant that flight software connects to: one protocol, over a network or over the pipes of a child process."""
