"""Formulas for gains: linear-quadratic regulators, pole placement, degree of stability, settling time of a slew."""
