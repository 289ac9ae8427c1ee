"""Certificates with one thing changed: what the kernel still accepts says what it said, or something else that is true."""

import pytest

from starhold.kernel.check import check
from tests.kernel.certificates import contents, text
from tests.kernel.mutations import refusals
from tests.kernel.oracle import Oracle
from tests.tiers import WHOLE, leading, source

SUITES = {
    "converges": ("three-laws", "lyapunov", 0),
    "within limits": ("three-laws", "lyapunov", 1),
    "whatever the inertia": ("three-laws", "lyapunov", 2),
    "between samples": ("three-laws", "lyapunov", 3),
    "slides": ("three-laws", "sliding", 0),
    "strictly": ("by hand", "strict", 0),
    "falls where it is slow": ("by hand", "near", 0),
    "near the inertia": ("by hand", "near", 2),
    "jumps": ("by hand", "jumping", 0),
    "clips": ("by hand", "clipped", 0),
    "clips within limits": ("by hand", "clipped", 1),
    "hysteresis": ("cubesat-slew", "pd", 0),
    "shortest": ("cubesat-slew", "lyapunov", 0),
    "without axes": ("landing", "rounded", 0),
    "taken over": ("taken over", "lyapunov", 0),
    "layer": ("cubesat-slew", "sliding", 0),
    "norm": ("by hand", "norm", 1),
    "points": ("flying", "cubesat", 0),
    "points in noise": ("flying", "noisy", 0),
    "points in random torques": ("flying", "shaken", 0),
    "points at what moves": ("flying", "moving", 0),
    "evenly": ("wheels-orbital", "wheel", 0),
    "evenly whatever the inertia": ("wheels-orbital", "wheel", 2),
    "wheels": ("wheels-orbital", "wheel", 1),
}
COUNT = 100 if WHOLE else 25
"""Mutations of each certificate; `make test-all` tries others each day."""
SLOW = {name for name in SUITES if name.startswith(("evenly", "wheels", "points", "jumps", "whatever", "falls"))}


@pytest.mark.parametrize("suite", leading(sorted(SUITES, key=lambda name: name in SLOW), 2))
def test_nothing_false_is_accepted(suite):
    original = contents(*SUITES[suite])
    assert check(text(original))

    def true(content, claim):
        return all(Oracle(content, claim, seed).holds() for seed in range(2))

    assert refusals(original, source(suite), COUNT, true) > COUNT / 3
