"""Flies closed loops: one lane, recorded (`lane`), or many abreast (`lanes`)."""
