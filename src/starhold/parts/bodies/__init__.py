"""Bodies: equations of motion and what laws measure, one per file."""
