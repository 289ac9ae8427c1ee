"""A time in which a sensor gives nothing new, for sensors that declare one."""

from __future__ import annotations

from typing import TypeAlias

from starhold.algebra.scalar import Scalar, Truth, both, less, less_equal
from starhold.algebra.words import number_of
from starhold.parts.contract import Parameter

Window: TypeAlias = tuple[Scalar, Scalar]
OUTAGE = Parameter("s", shape=(2,), spread=False, at_least=0.0, text="begin and end without readings; none if equal")
"""The declaration of outages, common to all sensors."""
NEVER: Window = (0.0, 0.0)


def in_steps(outage: Window, period: float) -> Window:
    """The outage in control steps. ValueError where it ends before it begins."""
    begin, end = outage
    if end < begin:
        raise ValueError(f"the outage ends at {end:g} s, before it begins at {begin:g} s")
    return (begin / period, end / period)


def is_out(step: int, window: Window) -> Truth:
    """Tell whether a control step lies in the outage, given in steps: at or after its begin, and before its end."""
    now = number_of(step)
    return both(less_equal(window[0], now), less(now, window[1]))
