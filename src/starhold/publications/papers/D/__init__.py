"""Publication D: its numbers and how they are measured."""
