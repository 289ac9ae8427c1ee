"""The shape of a certificate file: the keys of each object, and what each may hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from starhold.checker.exact import demand
from starhold.laws.modes import ENDS

Test: TypeAlias = Callable[[Any], bool]


def shaped(given: Any, shape: Mapping[str, Test], where: str) -> None:
    """That an object has exactly the keys of a shape, and under each what its test allows."""
    demand(isinstance(given, Mapping), f"{where} is not an object")
    demand(set(given) == set(shape), f"{where} has not the keys {', '.join(shape) or '(none)'}")
    for key, test in shape.items():
        demand(test(given[key]), f"{where} has something else than it may under {key}")


def certificate_shaped(given: Any) -> None:
    """That a certificate has the keys of one, and exactly the claims whose kinds it lists."""
    shaped({key: part for key, part in given.items() if key != "proof"}, CERTIFICATE, "the certificate")
    kinds = [claim.get("kind") for claim in given["claims"]]
    demand(given["kinds"] == kinds, f"the claims are not those listed: {', '.join(given['kinds']) or '(none)'}")


def outcome_of(parts: Sequence[Any]) -> str:
    """The outcome of a whole whose parts have these: refuted if one is, proved if there are some and all are."""
    if "refuted" in parts:
        return "refuted"
    return "proved" if parts and all(outcome == "proved" for outcome in parts) else "undecided"


def _number(x: Any) -> bool:
    if isinstance(x, bool) or not isinstance(x, (int, float)):
        return False
    try:
        return math.isfinite(x) and float(x) == x
    except OverflowError:
        return False


def _text(x: Any) -> bool:
    """Text of characters that can be written: no lone surrogates, none that steer a terminal."""
    return isinstance(x, str) and x.isprintable()


def _flag(x: Any) -> bool:
    return isinstance(x, bool)


def _object(x: Any) -> bool:
    return isinstance(x, Mapping)


def _plain(x: Any) -> bool:
    """Numbers, texts, lists and objects without an infinity in them."""
    if isinstance(x, Mapping):
        return all(isinstance(key, str) and _plain(value) for key, value in x.items())  # pyright: ignore
    return all(map(_plain, x)) if isinstance(x, list) else x is None or _flag(x) or _text(x) or _number(x)  # pyright: ignore


def _gain(x: Any) -> bool:
    return _text(x) or _number(x) or (isinstance(x, list) and all(map(_gain, x)))  # pyright: ignore


def _list(test: Test, count: int | None = None) -> Test:
    def holds(x: Any) -> bool:
        return isinstance(x, list) and (count is None or len(x) == count) and all(map(test, x))  # pyright: ignore

    return holds


def _one(*allowed: str) -> Test:
    return lambda x: isinstance(x, str) and x in allowed


def _or_none(test: Test) -> Test:
    return lambda x: x is None or test(x)


def _within(shape: Mapping[str, Test]) -> Test:
    return lambda x: isinstance(x, Mapping) and set(x) == set(shape) and all(shape[key](x[key]) for key in shape)  # pyright: ignore


_OUTCOME = _one("proved", "refuted", "undecided")
_VECTOR, _MAYBE = _list(_number, 3), _or_none(_number)
FILE: dict[str, Test] = {
    **dict.fromkeys(("format", "scenario", "note"), _text),
    "versions": lambda x: _object(x) and all(map(_text, x.values())),
    "programs": _object,
    **dict.fromkeys(("claims", "certificates"), _list(_object)),
}
PROVED: dict[str, Test] = {"kind": _text, "outcome": _one("proved", "refuted"), "proof": lambda x: type(x) is int and x >= 0}
"""A claim that the file has a proof of, by its place."""
CERTIFICATE: dict[str, Test] = {
    "name": lambda x: _text(x) and len(x) <= 1_000,
    "outcome": _OUTCOME,
    "subject": _object,
    "kinds": _list(_text),
    "claims": _list(_object),
}
CLAIM: dict[str, Test] = {
    "kind": _text,
    "outcome": _OUTCOME,
    "numbers": lambda x: _object(x) and _plain(x),
    "witness": lambda x: _object(x) and _plain(x),
    "assumptions": _list(_text),
    "obligations": _list(_object),
}
OBLIGATION: dict[str, Test] = {
    "name": _text,
    "how": _text,
    "outcome": _OUTCOME,
    "evidence": lambda x: _object(x) and _plain(x),
}
_EXACT, _SIGN, _BALLS, _ROOTS = ("exact identity",), ("exact inequality",), ("ball arithmetic",), ("certified roots",)
HOWS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("form", "target"), _EXACT),
    "descent": _SIGN + _BALLS,
    "only equilibrium": ("LaSalle",),
    "holds what is handed over": _BALLS,
    "torque": _BALLS,
    "strict": _SIGN + _BALLS,
    "other equilibrium repels": _SIGN + _ROOTS,
    **dict.fromkeys(("stable at the period", "stable at the longest"), _ROOTS),
    **dict.fromkeys(("positive", "single equilibrium in the set", "half turns repel", "jumps lower V"), _SIGN),
    **dict.fromkeys(("momentum", "end"), _SIGN),
    **dict.fromkeys(("start", "stable in between", "reach exceeds torque", "surface holds the target", "layer"), _SIGN),
    "no switch of the quaternion sign": _SIGN,
}
"""How each obligation may be shown, whatever the claim."""
_WHEELS: dict[str, Test] = {
    "axes": _list(_VECTOR),
    "torque_limit": _list(_MAYBE),
    "momentum_limit": _list(_MAYBE),
    "inertia": _list(_number),
    "least": _list(_VECTOR),
    "momentum": _list(_number),
    "allocation": _one("least-squares", "least-peak"),
    "total_momentum": _number,
}
_HISTORY: dict[str, Test] = {
    "interpolant": _one("rotation spline"),
    "times": _list(_number),
    "attitudes": _list(_list(_number, 4)),
    "rates": _list(_VECTOR),
}
_TARGET: dict[str, Test] = {
    "target": _text,
    "attitude": _or_none(_list(_number, 4)),
    "history": _or_none(_within(_HISTORY)),
}
_SWITCH: dict[str, Test] = {
    "levels": lambda x: _object(x) and set(x) <= set(ENDS) and all(map(_number, x.values())),
    "before": _within(_TARGET),
    "after": _within(_TARGET),
}
SUBJECT: dict[str, Test] = {
    "law": _text,
    "gains": lambda x: _object(x) and all(map(_gain, x.values())),
    "quaternion_sign": _one("as_published", "shortest", "hysteresis"),
    "hysteresis_width": _MAYBE,
    "inertia": _list(_VECTOR, 3),
    "limit": _one("axis", "norm", "none"),
    "torque_limit": _MAYBE,
    "orbit": _or_none(_within({"position": _VECTOR, "velocity": _VECTOR, "gravitational_parameter": _number})),
    "gravity_gradient": _flag,
    "target": _one("inertial", "orbital", "history"),
    "history": _or_none(_within(_HISTORY)),
    "target_rate": _number,
    "target_acceleration": _number,
    "modelled_torque": _VECTOR,
    "modelled_torque_norm": _number,
    "disturbance": _number,
    "control_period": _number,
    "assumed_away": _list(_text),
    "wheels": _or_none(_within(_WHEELS)),
    "switch": _or_none(_within(_SWITCH)),
}
UNKNOWN_BODY: dict[str, Test] = {"body": _text, "law": _text}
"""The subject where nothing is known of the body."""
STATION: dict[str, Test] = {
    "law": _text,
    "gains": lambda x: _object(x) and all(map(_gain, x.values())),
    **dict.fromkeys(("plant", "nominal"), lambda x: _object(x) and all(map(_number, x.values()))),
    "model": _one("linear", "nonlinear"),
    "limit": _one("axis", "norm", "none"),
    "control_limit": _MAYBE,
    "lag": _number,
    "control_period": _number,
    "assumed_away": _list(_text),
}
"""The subject where a loop keeps a craft near a libration point."""
_CONTENTS: dict[str, Test] = {
    "start": _MAYBE,
    "everything": _flag,
    "slew_angle": _number,
    "rate": _MAYBE,
    "rate_everywhere": _MAYBE,
}
NUMBERS: dict[str, dict[str, Test]] = {
    "convergence": {"level": _MAYBE, **_CONTENTS},
    "hand-over": {**dict.fromkeys(("level", "start", "rate", "angle"), _MAYBE), "everything": _flag},
    "torque-limit": {"level": _MAYBE, **_CONTENTS, "limit": _number, "kind": _one("axis", "norm")},
    "wheels": {
        "level": _MAYBE,
        **_CONTENTS,
        "momentum": _number,
        **dict.fromkeys(("motors", "wheel_momentum"), _list(_number)),
    },
    "inertia": {"tolerance": _MAYBE, **_CONTENTS},
    "pointing": {"torque": _number},
    "sampling": {
        **dict.fromkeys(("period", "radius", "longest"), _number),
        "every_shorter": _flag,
        "eigenvalues": _list(_list(_number, 2), 6),
    },
    "sliding": {
        "torque": _VECTOR,
        **dict.fromkeys(("margin", "surface", "angle", "rate", "slew_angle"), _number),
        "everything": _flag,
        "start": _MAYBE,
        "rate_start": _MAYBE,
    },
    "region": dict.fromkeys(("level", "slew_angle", "rate"), _number),
}
_PROOF: dict[str, Test] = {"stiffness": _MAYBE, "epsilon": _number, "rho": _number}
WITNESS: dict[str, dict[str, Test]] = {
    "convergence": {**_PROOF, "rate_bound": _MAYBE},
    "hand-over": {**_PROOF, **dict.fromkeys(("rate_bound", "attitude_level"), _MAYBE)},
    "torque-limit": {**_PROOF, **dict.fromkeys(("rate_bound", "shift", "weight"), _MAYBE)},
    "wheels": {**_PROOF, "rate_bound": _MAYBE},
    "inertia": {**_PROOF, "level": _MAYBE},
    "pointing": {},
    "sampling": {},
    "sliding": {},
    "region": dict.fromkeys(("p", "c2", "g", "m"), _number),
}
