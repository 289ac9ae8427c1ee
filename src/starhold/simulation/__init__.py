"""Flies closed loops: one lane, recorded (`lane`), or many in parallel (`lanes`)."""
