"""How ball arithmetic (python-flint `arb`) reads the scalar operations: every answer encloses the exact one.

A comparison of overlapping balls is undecided (None), and a select on it returns a ball that holds both branches.
"""

from __future__ import annotations

from typing import Any

from flint import arb


def sqrt(x: Any) -> Any:
    return arb(x).sqrt()


def less(a: Any, b: Any) -> bool | None:
    a, b = arb(a), arb(b)
    if a < b:
        return True
    return False if a >= b else None


def where(condition: bool | None, a: Any, b: Any) -> Any:
    if condition is None:
        return arb(a).union(arb(b))
    return a if condition else b


def both(a: bool | None, b: bool | None) -> bool | None:
    if a is False or b is False:
        return False
    return None if a is None or b is None else True


def either(a: bool | None, b: bool | None) -> bool | None:
    return opposite(both(opposite(a), opposite(b)))


def opposite(a: bool | None) -> bool | None:
    return None if a is None else not a
