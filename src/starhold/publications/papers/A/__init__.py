"""Publication A: its numbers and how they are measured."""
