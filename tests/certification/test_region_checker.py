"""The checker's reading of regions of the law `modal`: what holds, what fails, and its mathematics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from starhold.certification.subject import described, make_subject
from starhold.checker import check, passed
from starhold.laws import modal
from tests.certification.by_hand import TEXTBOOK, by_hand, proved_by_hand
from tests.certification.edits import content_at, replaced, spots
from tests.certification.loops import rotors
from tests.certification.regions import BETTER, PLAIN, A, B, by_formula, file, highest_turn, region
from tests.making import ORBITAL, aimed

ON_WHEELS = ["neither torque nor wheels limited, wheels without friction" if a == TEXTBOOK[4] else a for a in TEXTBOOK]


def faults(content):
    return {f.obligation: f.reason for f in check(content) if f.verdict == "fails"}


# --- what holds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("a", "witness", "held", "missed"),
    [
        # Where V' may vanish as random states tell, 3.58298 and 9.0606, up to 1e-4.
        (A, PLAIN, 3.5829, 3.5831),
        (A, PLAIN, 1e-6, 3.70),
        (A, BETTER, 9.0, 9.15),
        (A, BETTER, 9.0605, 9.0607),
        (A, BETTER, 1e-6, 9.21),
        (-0.2, PLAIN, 3.5528, 3.5530),
        (-0.2, BETTER, 8.8976, 8.8978),
        (-1.0, PLAIN, 3.6593, 3.6595),
        # The other equilibrium bounds the level.
        (-1.0, BETTER, 9.1999, 9.2001),
        (-2.0, PLAIN, 3.7956, 3.7958),
        (-2.0, BETTER, 9.1999, 9.2001),
        # A cross term whose strength changes sign beyond the set.
        (A, (5.0, -0.2, 2.0, -3.0), 3.2, 3.3),
    ],
)
def test_levels_up_to_where_v_may_rise_hold(a, witness, held, missed):
    assert faults(file(region(held, witness, a=a, slew_angle=0.0, rate=0.0), a)) == {}
    assert "descent" in faults(file(region(missed, witness, a=a, slew_angle=0.0, rate=0.0), a))


@settings(max_examples=40)
@given(some.floats(-2.0, -0.1), some.floats(-0.03, -0.003), some.integers(0, 2**32 - 1))
def test_v_falls_at_random_states_of_what_holds(a, b, seed):
    random = np.random.default_rng(seed)
    witness = (random.uniform(4.0, 6.0), random.uniform(-0.3, 0.2), random.uniform(1.0, 2.5), random.uniform(-0.2, 1.0))
    c = random.uniform(0.3, 1.0) * (2.0 * witness[0] + 4.0 * witness[1])
    found = faults(file(region(c, witness, a=a, slew_angle=0.0, rate=0.0), a, b))
    u, w, x = random.uniform(0.0, [[2.0], [12.0], [2.0]], size=(3, 20_000))
    x = np.where(random.random(x.size) < 0.3, np.sign(x - 1.0), x - 1.0)
    V, slope = by_formula(a, b, witness, u, w, x)
    rises = bool((slope[c >= V] >= 0.0).any())
    assert not rises or "descent" in found


@pytest.mark.parametrize("sign_policy", ["as_published", "shortest", "hysteresis"])
def test_the_quaternion_sign(sign_policy):
    assert faults(file(region(3.58, sign_policy=sign_policy), quaternion_sign=sign_policy)) == {}
    better = file(region(2.0, BETTER, sign_policy), quaternion_sign=sign_policy)
    assert list(faults(better)) == (
        [] if sign_policy == "as_published" else [better["certificates"][0]["claims"][0]["obligations"][-1]["name"]]
    )
    # With another root V falls beyond half a turn, where the shorter way switches.
    wide = file(region(4.5, sign_policy=sign_policy, a=-2.0), -2.0, -0.05, quaternion_sign=sign_policy)
    assert list(faults(wide)) == (["single equilibrium in the set"] if sign_policy == "shortest" else [])
    other = "hysteresis" if sign_policy != "hysteresis" else "as_published"
    assert faults(file(region(3.58, sign_policy=other), quaternion_sign=sign_policy))
    for width in (0.0, 1.0, 2.0):
        narrow = faults(file(region(3.58, sign_policy=sign_policy), quaternion_sign=sign_policy, hysteresis_width=width))
        assert list(narrow) == (["jumps lower V"] if sign_policy == "hysteresis" else [""])


@pytest.mark.parametrize(
    "inertia", [[[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]], [[7.0, 1.0, 2.0], [1.0, 8.0, 0.5], [2.0, 0.5, 9.0]]]
)
def test_the_inertia_drops_out(inertia):
    assert faults(file(region(9.0, BETTER), inertia=inertia)) == {}


@pytest.mark.parametrize("target", [ORBITAL, aimed((1.0, 0.0, 0.0, 0.0))])
def test_so_do_the_target_torque_that_is_known_and_what_wheels_store(target):
    loop = rotors("modal", modal.Gains((A,) * 3, (A,) * 3, B), target)
    subject = described(make_subject(loop))
    assert subject["wheels"] is not None
    for told, held in ((ON_WHEELS, True), (TEXTBOOK, False)):
        content = file(region(9.0, BETTER, assumptions=told))
        content["certificates"][0]["subject"] = subject
        assert passed(check(content)) == held


# --- what fails -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("c", "witness"), [(3.5829, PLAIN), (9.0605, BETTER)])
def test_a_number_that_says_more_fails(c, witness):
    content = file(region(c, witness, slew_angle=0.999999 * highest_turn(c, witness)))
    assert faults(content) == {}
    place = ("certificates", 0, "claims", 0, "numbers")
    for key, where in (("level", "descent"), ("slew_angle", ""), ("rate", "")):
        raised = replaced(content, (*place, key), lambda spot, k: spot.__setitem__(k, spot[k] * (1.0 + 1e-4)))
        assert list(faults(raised)) == [where], key
        for value in (-1.0, 1e9, None, math.inf, "1"):
            assert faults(replaced(content, (*place, key), lambda spot, k, v=value: spot.__setitem__(k, v))), (key, value)
    assert faults(replaced(content, (*place, "level"), lambda spot, k: spot.__setitem__(k, 0.0)))


def test_a_turn_beyond_where_v_is_largest_fails():
    # p u + c2 u2 is largest at u = 1.25, and lower again at the other equilibrium.
    witness = (5.0, -2.0, 2.0, 0.9)
    assert "" not in faults(file(region(3.13, witness, slew_angle=2.0 * math.acos(1.0 - 1.9), rate=0.0)))
    assert "" in faults(file(region(3.12, witness, slew_angle=2.0 * math.acos(1.0 - 1.9), rate=0.0)))
    assert "" in faults(file(region(3.12, witness, slew_angle=math.tau * 1.001, rate=0.0)))


def test_another_witness_fails():
    for witness, others in ((PLAIN, [3.999, 0.01, 0.01, 0.01]), (BETTER, [4.8, -0.3, 1.9, 1.1])):
        content = file(region(3.5829 if witness is PLAIN else 9.0605, witness))
        for key, other in zip(("p", "c2", "g", "m"), others, strict=True):
            for value in (other, -1.0, 1e300, None):
                changed = replaced(
                    content, ("certificates", 0, "claims", 0, "witness", key), lambda s, k, v=value: s.__setitem__(k, v)
                )
                assert faults(changed), (key, value)


@pytest.mark.parametrize("witness", [PLAIN, BETTER])
def test_nothing_can_be_taken_away_or_named_otherwise(witness):
    content = file(region(3.0, witness))
    claim = ("certificates", 0, "claims", 0)
    assert faults(content) == {}
    for path in spots(content_at(content, claim)):
        assert faults(replaced(content, (*claim, *path), lambda spot, key: spot.pop(key))), path
        if isinstance(content_at(content, (*claim, *path)), str):
            assert faults(replaced(content, (*claim, *path), lambda spot, key: spot.__setitem__(key, spot[key] + "x"))), path
    for part in ("obligations", "assumptions"):
        for change in (list.reverse, lambda found: found.append(found[0])):
            assert faults(replaced(content, (*claim, part), lambda spot, key, f=change: f(spot[key])))
    for part in ("numbers", "witness"):
        assert faults(replaced(content, (*claim, part), lambda spot, key: spot[key].__setitem__("more", 1.0)))


def test_other_gains_fail():
    for witness, c in ((PLAIN, 3.5829), (BETTER, 9.0605)):
        claim = region(c, witness)
        assert faults(file(claim)) == {}
        # A smaller root leaves a smaller set; of a larger one the same V at rest is larger, so that the turn is not in it.
        assert "descent" in faults(file(claim, 0.99 * A))
        assert list(faults(file(claim, 1.01 * A))) == [""]
        assert "descent" in faults(file(claim, A, 0.5 * B))


@pytest.mark.parametrize(
    ("gains", "reason"),
    [
        ({"phi_1": -0.429}, "phi_0 and phi_1 are not one number on every axis"),
        ({"phi_0": [A, A, -0.429]}, "phi_0 and phi_1 are not one number on every axis"),
        ({"phi_0": [[A, 0.0, 1e-9], [0.0, A, 0.0], [0.0, 0.0, A]]}, "phi_0 and phi_1 are not one number on every axis"),
        ({"phi_0": -A, "phi_1": -A}, "phi_0 and phi_1 are not negative"),
        ({"phi_0": 0.0, "phi_1": 0.0}, "phi_0 and phi_1 are not negative"),
        ({"b": 0.0}, "b is not negative"),
        ({"b": 0.01}, "b is not negative"),
    ],
)
def test_gains_that_a_region_is_not_for_are_named(gains, reason):
    content = file(region(1.0))
    content["certificates"][0]["subject"]["gains"].update(gains)
    assert list(faults(content).values()) == [reason]


def test_another_law_is_refused():
    content = by_hand("pd", {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}, [region(1.0)])
    assert list(faults(content).values()) == ["such a claim is for the law modal"]


# --- other kinds of claims about this law -----------------------------------------------------------------------------

UNREAD = "the law divides by 1 + |q|2, which such a claim does not take"
PROOF = {"stiffness": 0.1, "epsilon": 0.0, "rho": 0.0, "rate_bound": None}
CONTENTS = {"start": 0.01, "everything": False, "slew_angle": 0.1, "rate": 0.01, "rate_everywhere": None}
EASY = {"form": "exact identity", "target": "exact identity", "only equilibrium": "LaSalle", "torque": "ball arithmetic"}
CONVERGES = ("form", "positive", "descent", "target", "only equilibrium", "single equilibrium in the set")
END = {"torque": 1e-6, "start": 0.01, "level": 0.01, "slew_angle": 0.1, "rate_start": 0.01, "angle": 0.1, "rate": 0.01}
SURFACE = {
    "torque": [0.0] * 3,
    "margin": 1e-3,
    "surface": 0.0,
    "angle": 0.0,
    "rate": 0.0,
    "slew_angle": 0.1,
    "everything": False,
}
OTHERS = {
    "convergence": (CONVERGES, CONTENTS | {"level": 0.01}, PROOF, TEXTBOOK),
    "torque-limit": (
        (*CONVERGES, "torque"),
        CONTENTS | {"level": 0.01, "limit": 0.1, "kind": "axis"},
        PROOF | {"shift": None, "weight": None},
        [a for a in TEXTBOOK if a != TEXTBOOK[4]],
    ),
    "inertia": (
        ("form", "positive", "descent", "strict", "single equilibrium in the set"),
        CONTENTS | {"tolerance": 0.05},
        {"stiffness": 0.1, "epsilon": 1e-3, "rho": 0.5, "level": 0.01},
        [TEXTBOOK[0], "inertia within the tolerance", *TEXTBOOK[2:5], "no torque from outside", "target at rest"],
    ),
    "disturbance": (
        ("descent", "strict", "end", "start"),
        END | {"rate_everywhere": None},
        PROOF | {"epsilon": 1e-3, "rho": 0.5, "tau": 1e-3, "beta": 1e-3, "shift": None, "steps": []},
        [*TEXTBOOK[:5], "torque from outside bounded in norm"],
    ),
    "sliding": (
        ("form",),
        SURFACE | {"start": 0.01, "rate_start": 0.01},
        {},
        [*TEXTBOOK[:5], "torque from outside bounded on each axis"],
    ),
}


@pytest.mark.parametrize("kind", sorted(OTHERS))
def test_what_needs_polynomials_fails_with_a_sentence(kind):
    names, numbers, witness, told = OTHERS[kind]
    obligations = [(name, EASY.get(name, "exact inequality")) for name in names]
    found = check(file(proved_by_hand(kind, obligations, numbers, witness, told), torque_limit=0.05))
    reasons = {f.reason for f in found if f.verdict == "fails"}
    assert reasons
    assert not any(reason.startswith("cannot be verified") for reason in reasons), reasons
    assert UNREAD in reasons or kind == "sliding"
    if "stiffness" in witness and kind != "inertia":
        own = proved_by_hand(kind, obligations, numbers, witness | {"stiffness": None}, told)
        assert "the law declares no V" in {f.reason for f in check(file(own, torque_limit=0.05)) if f.verdict == "fails"}


def held(period, a=A):
    """Eigenvalues of the linear loop with a held torque; every axis has the same two."""
    pull = np.array([2.0 * a, -2.0 * a * a])
    step = np.array([[1.0, 0.0], [period / 2.0, 1.0]]) + np.outer([period, period**2 / 4.0], pull)
    return np.repeat(np.linalg.eigvals(step).astype(complex), 3)


def test_held_between_samples():
    roots = held(0.25)
    numbers = {
        "period": 0.25,
        "radius": float(np.abs(roots).max()) + 1e-9,
        "longest": 1.0,
        "every_shorter": True,
        "eigenvalues": [[float(z.real), float(z.imag)] for z in roots],
    }
    names = [("stable at the period", "certified roots"), ("stable at the longest", "certified roots")]
    names.append(("stable in between", "exact inequality"))
    told = [*TEXTBOOK[:3], "linear motion near rest on a target at rest", TEXTBOOK[4], "no torque from outside"]

    def claim(**changes):
        return proved_by_hand("sampling", names, numbers | changes, {}, told)

    assert faults(file(claim())) == {}
    # Spectra that differ have a linear loop too.
    uneven = {"phi_0": [-0.5, -0.6, -0.7], "phi_1": A, "b": B}
    assert "stable at the period" in faults(by_hand("modal", uneven, [claim()]))
    assert "stable at the period" in faults(file(claim(radius=float(np.abs(roots).max()) - 1e-9)))
    far = next(h for h in (2.0, 4.0, 8.0, 16.0) if np.abs(held(h)).max() > 1.0)
    assert "stable at the longest" in faults(file(claim(longest=far)))
    there = sorted(([float(z.real), float(z.imag)] for z in held(far)), key=lambda z: -math.hypot(*z))
    size = math.hypot(*there[0]) + 1e-9
    unstable = claim(eigenvalues=there, radius=size, period=far, longest=None, every_shorter=False)
    unstable["obligations"] = unstable["obligations"][:1]
    unstable["outcome"] = unstable["obligations"][0]["outcome"] = "refuted"
    unstable["obligations"][0]["evidence"] = {"eigenvalue": there[0]}
    content = file(unstable, control_period=far)
    content["certificates"][0]["outcome"] = "refuted"
    assert passed(check(content))
    content["certificates"][0]["subject"]["control_period"] = 0.25
    assert not passed(check(content))
