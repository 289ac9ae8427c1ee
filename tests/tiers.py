"""How much of long products a run of the tests goes through: a part in `make test`, the whole in `make test-all`."""

import os

import pytest

WHOLE = os.environ.get("STARHOLD_TESTS") == "whole"


def fewer(count: int, share: int = 5) -> int:
    """The number of random examples or steps to try: one in `share` of them, unless the whole is asked for."""
    return count if WHOLE else max(1, count // share)


def leading(cases, count=1):
    """Parameters of a test, of which `make test` tries the first `count` and `make test-all` every one."""
    given = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*values, marks=() if place < count else pytest.mark.slow) for place, values in enumerate(given)]
