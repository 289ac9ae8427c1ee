"""Times without new readings, for sensors that declare them: an outage, and the intervals between updates."""

from __future__ import annotations

from typing import TypeAlias

from starhold.algebra.circular import nearest
from starhold.algebra.scalar import Scalar, Truth, absolute, both, either, less, less_equal
from starhold.algebra.words import number_of
from starhold.parts.contract import Parameter

Window: TypeAlias = tuple[Scalar, Scalar]
OUTAGE = Parameter("s", shape=(2,), spread=False, at_least=0.0, text="begin and end of an outage; none if equal")
"""The declaration of outages, common to all sensors."""
NEVER: Window = (0.0, 0.0)
INTERVAL = Parameter("s", at_least=0.0, plain=(300.0, "ms"), text="between updates; each control step if 0")
"""The declaration of the time from update to update, common to all sensors."""
Silence: TypeAlias = tuple[Scalar, ...]
"""Begin and end of an outage in control steps, and the control steps from update to update if they are more than one."""


def in_steps(outage: Window, period: float, interval: float = 0.0) -> Silence:
    """Return the outage and the interval in control steps. Raise ValueError if the outage ends before it begins."""
    begin, end = outage
    if end < begin:
        raise ValueError(f"the outage ends at {end:g} s, before it begins at {begin:g} s")
    every = steps_of(interval, period)
    return (begin / period, end / period, *([every] if every > 1.0 else []))


def steps_of(interval: float, period: float) -> float:
    """Return the control steps from update to update."""
    return float(max(1, round(interval / period)))


def is_out(step: int, silence: Silence) -> Truth:
    """Tell whether a control step lies in the outage, at or after its begin and before its end, or between updates, which
    are counted from the start."""
    now, (begin, end, *interval) = number_of(step), silence
    out = both(less_equal(begin, now), less(now, end))
    for every in interval:
        out = either(out, less(0.5, absolute(now - every * nearest(now / every))))
    return out
