"""A kernel that checks proofs about control loops: it searches nothing, and imports the standard library alone."""
