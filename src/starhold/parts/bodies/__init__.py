"""Bodies: equations of motion and the measurements of laws, one per file."""
