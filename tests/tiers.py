"""How much of long products a run of the tests goes through: a part in `make test`, more or the whole in `make test-all`."""

import os
import random
from datetime import UTC, datetime

import pytest

WHOLE = os.environ.get("STARHOLD_TESTS") == "whole"
SEED = os.environ.setdefault("STARHOLD_SEED", f"{datetime.now(UTC):%Y%m%d}")
"""What is drawn depends on the day, and is alike for all workers, which inherit it; set it to draw what another day drew."""


def fewer(count: int, share: int = 5) -> int:
    """The number of random examples or steps to try: one in `share` of them, unless the whole is asked for."""
    return count if WHOLE else max(1, count // share)


def leading(cases, count=1):
    """Parameters of a test, of which `make test` tries the first `count` and `make test-all` every one."""
    given = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*values, marks=() if place < count else pytest.mark.slow) for place, values in enumerate(given)]


def of_the_day(cases, count):
    """So many of some cases, in their order, which differ from day to day."""
    cases = [*cases]
    places = random.Random(f"{SEED} {len(cases)}").sample(range(len(cases)), min(count, len(cases)))
    return [cases[k] for k in sorted(places)]


def drawn(cases, count, first=1):
    """Parameters of a test whose cases are a product: `make test` tries the first ones, `make test-all` so many others
    besides, which differ from day to day."""
    cases = [*cases]
    return leading([*cases[:first], *of_the_day(cases[first:], count)], first)


def source(name):
    """A source of random numbers for a test: `make test` has the same each day, `make test-all` another."""
    return random.Random(f"{name} {SEED}" if WHOLE else name)


def seeds(count):
    """Seeds of random examples that differ from day to day."""
    begin = int.from_bytes(random.Random(SEED).randbytes(3))
    return range(begin, begin + count)
