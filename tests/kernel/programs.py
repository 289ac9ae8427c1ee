"""Programs of certificates read in floats, and the numbers there."""

import math
from fractions import Fraction

import numpy as np

PLAIN = {
    "plus": "{} + {}", "minus": "{} - {}", "product": "{} * {}", "divide": "{} / {}", "negative": "-{}", "sqrt": "sqrt({})",
    "less": "{} < {}", "less_equal": "{} <= {}", "select": "select({}, {}, {})", "both": "{} & {}", "either": "{} | {}",
    "opposite": "{} ^ True",
}  # fmt: skip


def number(text):
    return float.fromhex(text) if "x" in text else float(Fraction(text))


def select(truth, a, b):
    return np.where(truth, a, b) if np.ndim(truth) else a if truth else b


def written(program):
    """A program with a function that runs it, which is written from its steps as they are now."""
    count, lines = len(program["inputs"]), []
    for k, (name, *operands) in enumerate(program["steps"], count):
        value = repr(number(operands[0])) if name == "constant" else PLAIN[name].format(*(f"v{n}" for n in operands))
        lines.append(f"    v{k} = {value}\n")
    given, outputs = (", ".join(f"v{k}" for k in places) for places in (range(count), program["outputs"]))
    names = {"select": select, "sqrt": math.sqrt, "inf": math.inf, "nan": math.nan}
    exec(f"def told({given}):\n{''.join(lines)}    return [{outputs}]\n", names)
    return {**program, "function": names["told"]}


def run(program, given):
    told = program if "function" in program else written(program)
    return np.array(told["function"](*(given[name] for name in program["inputs"])), dtype=float)
