"""Balls of python-flint read equations: what they give holds the exact value, and its radius is what rounding may do."""

import operator
from typing import Any

from flint import arb

from starhold.algebra.operations import Operation


def arithmetic(apply: Any) -> Any:
    """An operator between balls and numbers, from either side."""
    return lambda a, b: Ball(apply(a.arb, arb_of(b))), lambda b, a: Ball(apply(arb_of(a), b.arb))


class Ball:
    """A ball that equations take for a number."""

    reader = "itself"

    def __init__(self, middle: Any, radius: float = 0.0) -> None:
        self.arb = arb(middle, radius) if radius else arb(middle)

    __add__, __radd__ = arithmetic(operator.add)
    __sub__, __rsub__ = arithmetic(operator.sub)
    __mul__, __rmul__ = arithmetic(operator.mul)
    __truediv__, __rtruediv__ = arithmetic(operator.truediv)

    def __neg__(self) -> "Ball":
        return Ball(-self.arb)

    def read(self, entry: Operation, values: Any) -> Any:
        """What an operation gives of balls: a truth that they do not decide is undecided."""
        if entry.name == "sqrt":
            return Ball(self.arb.sqrt())
        if entry.name == "select":
            return entry.plain(*values)
        if "slopes" in entry.meanings:
            first, *more = map(arb_of, values)
            name = {"power": "__pow__", "cbrt": "root"}.get(entry.name, entry.name)
            return Ball(getattr(arb, name)(first, *(more or [3] * (name == "root"))))
        if entry.name not in ("less", "less_equal"):
            # The remaining operations on numbers are those of arithmetic.
            return entry.meanings["symbolic"](*values)
        a, b = map(arb_of, values)
        if entry.name == "less":
            return True if a < b else False if a >= b else UNDECIDED
        return True if a <= b else False if a > b else UNDECIDED


class Undecided:
    """The truth of a comparison that holds at some points of the balls only."""

    reader = "itself"

    def read(self, entry: Operation, values: Any) -> Any:
        """What an operation gives for both truths: the same, or a ball that holds both numbers."""
        if entry.name == "select":
            return Ball(arb_of(values[1]).union(arb_of(values[2])))
        found = {entry.plain(*(truth if x is self else x for x in values)) for truth in (True, False)}
        return self if len(found) > 1 else found.pop()


UNDECIDED = Undecided()


def arb_of(number: Any) -> arb:
    """The ball itself, of a number one without radius."""
    return number.arb if isinstance(number, Ball) else arb(number)
