"""Formulas for gains: linear quadratic regulators, pole placement, degree of stability, a slew that settles in time."""
