"""Certificates written without the certifier, for the tests of the checker."""

import math

TEXTBOOK = (
    "rigid body",
    "inertia exactly as given",
    "exact measurement and ideal actuators",
    "torque applied continuously",
    "torque not limited",
    "no torque from outside but what the law cancels",
)


def proved_by_hand(kind, names, numbers, witness, assumptions=TEXTBOOK):
    obligations = [{"name": name, "how": how, "outcome": "proved", "evidence": {}} for name, how in names]
    return {
        "kind": kind,
        "outcome": "proved",
        "numbers": numbers,
        "witness": witness,
        "assumptions": list(assumptions),
        "obligations": obligations,
    }


def by_hand(law, gains, claims, **changes):
    """A file with one certificate, written without the certifier."""
    subject = {
        "law": law,
        "gains": gains,
        "quaternion_sign": "as_published",
        "hysteresis_width": 0.5 if changes.get("quaternion_sign") == "hysteresis" else None,
        "inertia": [[2.0, 0.1, 0.0], [0.1, 3.0, -0.25], [0.0, -0.25, 4.0]],
        "limit": "axis",
        "torque_limit": None,
        "orbit": None,
        "gravity_gradient": False,
        "target": "inertial",
        "history": None,
        "target_rate": 0.0,
        "target_acceleration": 0.0,
        "modelled_torque": [0.0, 0.0, 0.0],
        "modelled_torque_norm": 0.0,
        "disturbance": 0.0,
        "control_period": 0.25,
        "assumed_away": [],
        "wheels": None,
        "switch": None,
        **changes,
    }
    outcome = "undecided" if [claim["kind"] for claim in claims] == ["sampling"] else "proved"
    kinds = [claim["kind"] for claim in claims]
    certificate = {"name": law, "outcome": outcome, "subject": subject, "kinds": kinds, "claims": claims}
    about = {"scenario": "hand", "versions": {}, "note": "", "programs": {}, "claims": []}
    return {"format": "starhold certificate 3", **about, "certificates": [certificate]}


HOWS = {
    "form": "exact identity",
    "positive": "exact inequality",
    "descent": "exact inequality",
    "target": "exact identity",
    "only equilibrium": "LaSalle",
    "strict": "exact inequality",
    "single equilibrium in the set": "exact inequality",
    "jumps lower V": "exact inequality",
    "other equilibrium repels": "certified roots",
}


def converging(last="other equilibrium repels", middle="only equilibrium", **changes):
    names = [(n, HOWS[n]) for n in ("form", "positive", "descent", "target", middle, last)]
    numbers = {
        "level": None,
        "start": None,
        "slew_angle": 2.0 * math.pi,
        "rate": None,
        "rate_everywhere": None,
        "everything": True,
    }
    witness = {"stiffness": None, "epsilon": 0.0, "rho": 0.0, "rate_bound": None}
    numbers |= {k: v for k, v in changes.items() if k in numbers}
    witness |= {k: v for k, v in changes.items() if k in witness}
    return proved_by_hand("convergence", names, numbers, witness)


PD = {"k_rate": 0.09, "k_attitude": 0.009, "limit": "none"}
SPUN = {"k_rate": [0.5, 0.6, 0.7], "k_attitude": [0.01, 0.02, 0.03], "gyroscopic": 0.0}
