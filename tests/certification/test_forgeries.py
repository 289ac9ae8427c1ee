"""Certificates with a number, a premise or an entry changed: the checker refuses each that does not say something true."""

import json
import math

import numpy as np
import pytest

from starhold.certification.certificate import write
from starhold.certification.certify import Wanted, certify
from starhold.checker import check, passed
from starhold.laws.catalogue import catalogue
from tests.certification.edits import alone, changed, claims_of, content_at, spots
from tests.certification.handed import POINT, bounded, handed
from tests.certification.loops import certified, free, loop_of, rotors, textbook
from tests.making import ORBITAL

QUICK = {
    "pd": lambda: certified("pd-0", "shortest", 1e-4),
    "sliding": lambda: certified("sliding-1", "shortest", 1e-4),
    "hand-over": lambda: handed(bounded("6 deg/s", "120 deg") + POINT),
}
MORE = {
    "lqr": lambda: certified("lqr-I", "hysteresis", 1e-4),
    "orbital": lambda: certify(
        loop_of("pd", textbook()["pd-0"].gains, target=ORBITAL), "orbital", Wanted(inertia_tolerance=0.05, disturbance=1e-4)
    ),
    "modal": lambda: certify(free(loop_of("modal", catalogue()["modal"].examples()[0]))),
    "wheels": lambda: certify(rotors("pd", textbook()["pd-0"].gains)),
}
SAYS_LESS = ("slew_angle", "rate", "rate_start", "rate_everywhere", "longest", "margin", "tolerance")
"""Numbers of claims of which a smaller one, or none where there need be none, says less."""
BOUNDS_MORE = {("disturbance", "angle"), ("disturbance", "rate"), ("sliding", "angle"), ("sliding", "rate")}
"""Numbers of claims of which a larger one says less."""
HINTS = ("rate_bound", "epsilon", "m", "steps")
"""Witnesses of which another one may prove the same."""
ANOTHER_LOOP = ("gains", "inertia", "orbit", "torque_limit", "control_period", "wheels", "switch", "hysteresis_width")
"""Numbers of the loop itself, with others of which a claim may hold as well."""
PREMISES = ("modelled_torque", "modelled_torque_norm", "target_rate", "target_acceleration")
"""Bounds of what acts on the loop, of which larger ones hold as well."""


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    def content(name):
        path = tmp_path_factory.mktemp("forged") / "certificate.json"
        write([{**QUICK, **MORE}[name]()], "made", path)
        return json.loads(path.read_text(encoding="utf-8"))

    return content


def forged(value):
    """Other values in the place of one."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, (int, float)):
        return [*({2.0 * value, 0.5 * value, -value, 0.0, 1e308} - {value}), None]
    if isinstance(value, list):
        return [value[:-1], [*value, value[-1]], []] if value else [[1.0]]
    if isinstance(value, dict):
        return [{**value, "more": 1.0}, *({k: v for k, v in value.items() if k != key} for key in value)]
    return [f"{value}x"] if isinstance(value, str) else [0.0, 1.0, 1e308]


def is_true(path, kind, old, new):
    """Whether what stands in the file after a change is as true as before: a name, a weaker claim, another witness of the
    same claim, or a loop for which the claim holds too."""
    parts = [key for key in path if isinstance(key, str)]
    numbers = type(old) is float and type(new) is float
    if "versions" in parts or (parts[-1] in ("name", "scenario") and "obligations" not in parts):
        return True
    if parts[1:] == [] or parts[-1] == "eigenvalues":
        return isinstance(new, list) and new[:-1] == old
    if "subject" in parts:
        if parts[-1] == "disturbance":
            return numbers and new <= old and kind in ("disturbance", "sliding")
        if set(PREMISES) & set(parts):
            return numbers and (new >= old or (kind == "sampling" and new >= 0.0))
        unlimited = None in (old, new) and bool({"torque_limit", "momentum_limit"} & set(parts))
        return bool(set(ANOTHER_LOOP) & set(parts)) and (numbers or unlimited)
    if "witness" in parts:
        return parts[-1] in HINTS
    if (kind, parts[-1]) in BOUNDS_MORE:
        return numbers and new >= old
    less = new is None if old is None or new is None else 0.0 <= new <= old if numbers else False
    return (parts[-1] in SAYS_LESS and less) or (parts[-1] == "limit" and numbers and 0.0 < new < old)


def survivors(content, random, share):
    """Forgeries of a file, a share of all, that pass though they are not true; and how many there were."""
    found, count = [], 0
    kinds = list(claims_of(content))
    for path in spots(content):
        old = content_at(content, path)
        for new in forged(old):
            if random.uniform() > share:
                continue
            count += 1
            inside = path[:3] == ("certificates", 0, "claims") and len(path) > 4
            kind = kinds[path[3] if inside else random.integers(len(kinds))]
            # One claim is enough to see whether that claim fails.
            one = alone(content, kind) if inside or "subject" in path else content
            place = (*path[:3], 0, *path[4:]) if inside else path
            there = content_at(one, place)
            forgery = new != there and not is_true(path, kind, there, new)
            if forgery and passed(check(changed(one, place, new))):
                found.append((kind, path[2:], old, new))
    return found, count


@pytest.mark.parametrize(("name", "share"), [("pd", 0.01), ("sliding", 0.02), ("hand-over", 0.05)])
def test_a_sample_of_forgeries_is_refused(name, share, stored):
    content = stored(name)
    assert passed(check(content))
    found, count = survivors(content, np.random.default_rng(25), share)
    assert found == []
    assert count > 5


@pytest.mark.slow
@pytest.mark.parametrize("name", [*QUICK, *MORE])
def test_no_forgery_passes(name, stored):
    found, count = survivors(stored(name), np.random.default_rng(1), 0.2)
    assert found == []
    assert count > 50


@pytest.mark.parametrize("kind", ["convergence", "sampling"])
def test_a_disturbance_that_no_claim_is_about_is_refused(kind, stored):
    content = alone(stored("pd"), kind)
    for torque in (1e308, 1e-9):
        forgery = changed(content, ("certificates", 0, "subject", "disturbance"), torque)
        assert [finding.reason for finding in check(forgery)] == ["no claim is about the disturbance"]


def test_a_claim_that_is_deleted_is_missed(stored):
    content = stored("pd")
    for place in range(len(claims_of(content))):
        claims = content["certificates"][0]["claims"]
        forgery = changed(content, ("certificates", 0, "claims"), claims[:place] + claims[place + 1 :])
        assert [finding.verdict for finding in check(forgery)] == ["fails"]


def test_a_hand_over_is_of_the_switch_that_the_file_holds(stored):
    """A switch at 60 deg/s lets the next mode begin with more than its set holds, whatever a claim says of rates."""
    content = stored("hand-over")
    switch = ("certificates", 0, "subject", "switch")
    rate = (*switch, "levels", "rate_below")
    assert math.degrees(content_at(content, rate)) == pytest.approx(6.0)
    for fast in (
        changed(content, rate, math.radians(60.0)),
        changed(content, (*switch, "levels"), {}),
        changed(content, (*switch, "before", "attitude"), [0.0, 1.0, 0.0, 0.0]),
        changed(content, switch, None),
    ):
        assert not passed(check(fast))
    slow = ("certificates", 0, "claims", 0, "numbers", "rate")
    assert not passed(check(changed(content, slow, 1e-3)))
    # A rate that the mode before does not reach is as good.
    assert passed(check(changed(content, rate, math.radians(5.0))))
