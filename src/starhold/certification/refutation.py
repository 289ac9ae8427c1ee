"""States that refute: guessed in floats, verified in exact rationals on the loop's own equations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq

from starhold.algebra.polynomial import Polynomial, exact
from starhold.certification.matrices import floats, number, symmetric_part
from starhold.certification.motion import ATTITUDE, RATE, Truths
from starhold.certification.potential import Cosines

if TYPE_CHECKING:
    from starhold.certification.frame import Frame


def state_evidence(attitude: Sequence[Any], rate: Sequence[Any], what: str, value: Any) -> dict[str, Any]:
    """A state and what is found there."""
    return {
        "state": {"attitude": [number(x) for x in attitude], "rate": [number(x) for x in rate]},
        what: number(value),
    }


def rational_turn(attitude: Sequence[float]) -> list[Any]:
    """A rational quaternion of exactly unit length near a float one, by stereographic projection."""
    q = np.asarray(attitude, dtype=float)
    sign = 1 if q[0] >= 0 else -1
    t = [exact(float(f"{x:.6g}")) for x in sign * q[1:] / (1.0 + sign * q[0])]
    square = sum((x * x for x in t), fmpq(0))
    return [sign * (1 - square) / (1 + square), *(sign * 2 * x / (1 + square) for x in t)]


def rising_state(truths: Truths, slope: Polynomial, rate: Any | None, tries: int = 200) -> dict[str, Any] | None:
    """A state with |w| <= rate (None: any) at which V' > 0 without torque from outside on a piece of it, verified; None if
    none is found."""
    own = slope.only(lambda m: not any(name[0] in "emra" for name in m))
    names = [*ATTITUDE, *RATE]
    compiled = [([names.index(n) for n in m], number(c)) for m, c in own.terms.items()]

    def value(x: Any) -> Any:
        return sum(c * np.prod(x[..., places], axis=-1) for places, c in compiled)

    random = np.random.default_rng(0)
    w = random.normal(size=(tries * 50, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    on_target = np.tile((1.0, 0.0, 0.0, 0.0), (len(w), 1))
    turned = random.normal(size=(len(w), 4))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    # On target and at everyday rates first, where a reader sees most.
    lengths = (
        10.0 ** np.array(sorted(range(-6, 19), key=abs))
        if rate is None
        else number(rate) * np.append(np.linspace(0.99999, 0.1, 10), np.logspace(-2, -6, 5))
    )
    for q in (on_target, turned):
        for length in lengths:
            found = value(np.hstack([q, length * w]))
            place = int(np.argmax(found))
            if found[place] > 0.0:
                verified = _verified(truths, own, q[place], length * w[place], rate)
                if verified is not None:
                    return verified
    return None


def _verified(truths: Truths, slope: Polynomial, attitude: Any, rate: Any, limit: Any | None) -> dict[str, Any] | None:
    turn = rational_turn(attitude)
    w = [exact(float(f"{x:.6g}")) for x in rate]
    if limit is not None and sum((x * x for x in w), fmpq(0)) > limit * limit:
        return None
    values: dict[str, Any] = dict(zip([*ATTITUDE, *RATE], [*turn, *w], strict=True))
    conditions = [condition.positive for condition, _ in truths]
    values |= dict.fromkeys({name for p in conditions for name in p.variables()} - set(values), fmpq(0))
    if any((p.at(values) > 0) != truth for p, (_, truth) in zip(conditions, truths, strict=True)):
        return None
    value = slope.at(values)
    return state_evidence(turn, w, "V'", value) if value > 0 else None


def unlike_positive(frame: Frame) -> dict[str, Any]:
    """A state at which V is not positive, or why none is told."""
    still, on_target = (fmpq(0),) * 3, (fmpq(1), *(fmpq(0),) * 3)
    values, axes = np.linalg.eigh(floats(symmetric_part(frame.P)))
    w = [exact(float(f"{x:.9g}")) for x in axes[:, 0]]
    tried: list[tuple[Any, Any]] = [(on_target, w), ((fmpq(0), fmpq(1), *still[:2]), still)]
    if isinstance(frame.potential, Cosines):
        tried.append((rational_turn([0.0, *np.linalg.eigh(floats(frame.potential.N))[1][:, 0].tolist()]), still))
    for q, rate in tried:
        energy = sum((rate[i] * frame.P[i][j] * rate[j] for i in range(3) for j in range(3)), fmpq(0)) / 2
        value = energy + frame.potential.at(q)
        if value <= 0:
            return state_evidence(q, rate, "V", value)
    return {"reason": f"P has the eigenvalue {values[0]:g}, or the attitude's part of V is not positive"}
