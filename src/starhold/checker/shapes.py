"""The shape of a certificate file: the keys of each object, and what each may hold."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

Test: TypeAlias = Callable[[Any], bool]
Verdict: TypeAlias = Literal["holds", "fails", "not claimed"]


class CheckError(Exception):
    """Why something in a certificate does not hold, or cannot be verified."""


def demand(holds: bool, otherwise: str) -> None:
    """Raise a CheckError unless something holds."""
    if not holds:
        raise CheckError(otherwise)


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
