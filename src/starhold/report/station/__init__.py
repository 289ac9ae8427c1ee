"""Reports of station keeping."""
