"""Publication B: its numbers and how they are measured."""
