"""Programs of certificates read in floats, and the numbers there."""

import math
from fractions import Fraction
from functools import cache

import numpy as np

PLAIN = {
    "plus": lambda a, b: a + b,
    "minus": lambda a, b: a - b,
    "product": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negative": lambda a: -a,
    "sqrt": math.sqrt,
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "select": lambda t, a, b: np.where(t, a, b) if np.ndim(t) else a if t else b,
    "both": lambda a, b: a & b,
    "either": lambda a, b: a | b,
    "opposite": lambda a: a ^ True,
}


@cache
def number(text):
    return float.fromhex(text) if "x" in text else float(Fraction(text))


def run(program, given):
    values = [given[name] for name in program["inputs"]]
    for name, *operands in program["steps"]:
        values.append(number(operands[0]) if name == "constant" else PLAIN[name](*(values[k] for k in operands)))
    return np.array([values[k] for k in program["outputs"]], dtype=float)
