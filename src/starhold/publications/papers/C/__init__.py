"""Publication C: its numbers and how they are measured."""
