"""Random craft with hinged panels or bending modes, under laws near their target, flown against every bound of their claims:
`python -m tests.kernel.test_appendages_hunt SEED COUNT` prints what came of each."""

import json
import sys

import numpy as np
import pytest

from starhold.certification.evidence.appendages import find_appended
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import certificate
from starhold.certification.subject import make_subject
from starhold.errors import InputError
from starhold.kernel.check import check
from starhold.scenario.reading import make_scenario
from tests.certification.hunt import random_inertia
from tests.kernel.swaying import Swaying
from tests.making import built


def random_loop(random):
    """A loop of inertia, appendages, law, gains, period, and parts that push and measure, all at random."""
    J = random_inertia(random, 10.0 ** random.uniform(0.0, 3.0))
    moments = np.linalg.eigvalsh(J)
    w = 10.0 ** random.uniform(-1.5, -0.3)
    k, d = w * w * moments[-1], 2.0 * w * moments[-1] * random.uniform(0.4, 1.5)
    part = modes_of(random, moments[0], w) if random.uniform() < 0.6 else panels_of(random, moments[0], w)
    period = float(f"{random.uniform(0.01, 0.12) / w:.3g}")
    more = []
    if random.uniform() < 0.4:
        more.append({"type": "constant-torque", "torque": list(random.normal(size=3) * k * 10.0 ** random.uniform(-6, -4))})
    if random.uniform() < 0.3:
        more += [
            {"type": "gyro", "bias": list(random.normal(size=3) * w * 1e-5)},
            {"type": "star-tracker", "cross": 0, "roll": 0, "mounting_error": list(random.normal(size=3) * 1e-5)},
        ]
    law = str(random.choice(["pd", "lyapunov"]))
    sign = str(random.choice(["as_published", "shortest", "hysteresis"]))
    tables = {
        "name": "hunted",
        "spacecraft": {"inertia": J.tolist()} | ({"torque_limit": 0.3 * k} if random.uniform() < 0.5 else {}),
        "initial": {"angles": [0, 0, "0.1 deg"]},
        "target": {"mode": "inertial", "attitude": [1, 0, 0, 0]},
        "simulation": {"duration": 100.0 * period, "control_period": period, "substeps": 8},
        "part": [part, *more],
        "law": [{"type": law, "k_rate": d, "k_attitude": k, "quaternion_sign": sign}],
    }
    return built(make_scenario(tables))


def modes_of(random, least, w):
    rows = []
    for _ in range(int(random.integers(1, 4))):
        coupling = random.normal(size=3)
        coupling *= np.sqrt(least * random.uniform(0.02, 0.25)) / np.linalg.norm(coupling)
        rows.append([w * 10.0 ** random.uniform(0.3, 1.0), 10.0 ** random.uniform(-2.5, -1.0), *coupling, 0.0])
    return {"type": "flexible-modes", "modes": rows}


def panels_of(random, least, w):
    rows, mass = [], 20.0 * least**0.6
    for side in (1.0, -1.0)[: int(random.integers(1, 3))]:
        m, out = mass * random.uniform(0.01, 0.05), random.uniform(0.2, 0.5) * (least / mass) ** 0.5
        swung = m * out * out
        axis = random.normal(size=3) * (0.2, 0.0, 0.2) + (1.0, 0.0, 0.0)
        about = swung * random.uniform(0.1, 0.4)
        f = w * 10.0 ** random.uniform(0.3, 1.0)
        spring, damper = f * f * (swung + about), 2.0 * 10.0 ** random.uniform(-2.3, -1.0) * f * (swung + about)
        rows.append([m, 0, side * 0.3 * out, 0, *axis, 0, side * out, 0, about, 0.2 * about, 1.1 * about, spring, damper, 0])
    return {"type": "hinged-panels", "mass": mass, "panels": rows}


def hunted(seed, seconds=60.0, lanes=24):
    """How far flights come, as a share of what is claimed; None of a craft that no claim is about, and why."""
    random = np.random.default_rng(seed)
    try:
        recorded = Loop(make_subject(random_loop(random)))
    except (InputError, ValueError) as reason:
        return None, str(reason)
    if not find_appended(recorded):
        return None, next(iter(recorded.failed.values()), "")
    content = json.loads(json.dumps(certificate(recorded.programs, recorded.claims)))
    (proved,) = check(json.dumps(content))
    flown = Swaying(content, seed, lanes).against(min(seconds, 600 * recorded.loop.period))
    flown.pop("flown")
    return flown, proved.statement.text[:60]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_random_craft_breaks_its_claim(seed):
    flown, reason = hunted(seed)
    assert reason
    assert flown is None or max(flown.values()) <= 1.0 + 1e-6


if __name__ == "__main__":
    first, count = map(int, sys.argv[1:3])
    for one in range(first, first + count):
        print(one, *hunted(one), flush=True)
