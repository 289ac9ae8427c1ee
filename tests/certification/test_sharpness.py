"""How near proved bounds are to the worst that a search finds: never beneath it, and not far above."""

from dataclasses import replace

import numpy as np
import pytest

from starhold.algebra.vector import ZERO
from starhold.certification.certify import certify
from starhold.laws.interface import Measurement, NoMemory
from starhold.trace.calling import Compiled
from tests.certification.loops import tensor, textbook
from tests.kernel.oracle import number as number_of
from tests.kernel.oracle import run
from tests.tiers import leading

LOOPS = textbook()


def largest_torque(loop, claim, level, kind):
    """The largest torque in norm, or on an axis, that a random search finds on {V <= level}, by the V of the proof."""
    found = claim.proof.claim
    V, J = claim.proof.programs[found["programs"]["lyapunov"]], np.array(tensor(loop.craft.inertia))
    numbers = {name: number_of(x) for name, x in found["subject"].items()}
    for name, matrix in (("inertia", J), ("inverse_inertia", np.linalg.inv(J))):
        numbers |= {f"craft.{name}.{i}.{k}": matrix[i, k] for i in range(3) for k in range(3)}
    random = np.random.default_rng(2)

    def command(q, w):
        return loop.law.command(Measurement(q, w, w, ZERO, ZERO, ZERO, ZERO, 0.1, ZERO), loop.gains, loop.craft, NoMemory())[
            0
        ]

    torque = Compiled(command, (1.0, 0.0, 0.0, 0.0), ZERO)

    def value(q, w):
        state = {f"measurement.attitude.{k}": x for k, x in enumerate(q)} | {
            f"measurement.rate.{k}": x for k, x in enumerate(w)
        }
        return run(V, numbers | state)[0]

    rest = value(np.eye(4)[:1].T, np.zeros((3, 1)))

    def size(x):
        axes, way = (part / np.linalg.norm(part, axis=0) for part in (x[:3], x[3:6]))
        # A turn to a share of the level, then the rate in the given direction at which V is the level.
        low, high = 0.0 * x[6], np.full(x.shape[1], np.pi)
        for _ in range(40):
            half = 0.25 * (low + high)
            below = value(np.vstack([np.cos(half), np.sin(half) * axes]), 0.0 * way) - rest < level * 0.5 * (
                1.0 + np.sin(x[6])
            )
            low, high = np.where(below, 2.0 * half, low), np.where(below, high, 2.0 * half)
        q = np.vstack([np.cos(0.5 * low), np.sin(0.5 * low) * axes])
        still, one, other = (value(q, s * way) for s in (0.0, 1.0, -1.0))
        a, b, c = 0.5 * (one + other) - still, 0.5 * (one - other), still - rest - level
        u = torque.over(np.vstack([q, (np.sqrt(b * b - 4.0 * a * c) - b) / (2.0 * a) * way]))
        return np.linalg.norm(u, axis=0) if kind == "norm" else np.abs(u).max(axis=0)

    x = random.normal(size=(7, 20_000))
    x = x[:, np.argsort(size(x))[-64:]]
    best = size(x)
    for _ in range(400):
        tried = x + random.normal(size=x.shape) * 10.0 ** random.uniform(-3.5, -0.5, size=x.shape[1])
        sizes = size(tried)
        x, best = np.where(sizes > best, tried, x), np.maximum(best, sizes)
    return float(best.max())


@pytest.mark.parametrize(
    ("name", "kind", "share"),
    leading(
        [
            ("lyapunov-0", "norm", 0.96),
            ("lyapunov-1", "axis", 0.98),
            ("pd-0", "norm", 0.998),
            ("wheel-0", "norm", 0.96),
            ("lqr-I", "axis", 0.97),
            ("lyapunov-0", "axis", 0.95),
            ("lyapunov-1", "norm", 0.98),
            ("lqr-I", "norm", 0.98),
            ("lqr-I-gyroscopic-left", "axis", 0.97),
            ("lqr-I-gyroscopic-left", "norm", 0.97),
            ("lqr-III", "axis", 0.998),
            ("lqr-III", "norm", 0.97),
            ("pd-0", "axis", 0.998),
            ("matrix-pd-inertial", "norm", 0.87),
            ("matrix-pd-inertial", "axis", 0.87),
        ],
        3,
    ),
)
def test_the_level_under_a_torque_limit_against_the_largest_that_is_safe(name, kind, share):
    """No state within the level needs more torque than the limit, and one within level/share does."""
    loop = replace(LOOPS[name], limit=kind)
    claim = certify(loop, name).claim("torque-limit")
    assert claim.outcome == "proved"
    limit, level = claim.numbers["limit"], claim.numbers["level"]
    assert largest_torque(loop, claim, level, kind) <= limit * (1.0 + 1e-12)
    assert largest_torque(loop, claim, level / share, kind) > limit
