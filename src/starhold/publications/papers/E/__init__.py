"""Publication E: its numbers and how they are measured."""
