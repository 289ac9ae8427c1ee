"""The claim that a sliding-mode law reaches its surface s = w + Kq against every torque it must stand, and that the motion
then ends on target, or near it where the switching has a boundary layer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from flint import arb, fmpq

from starhold.algebra.polynomial import Polynomial, exact, jointly, pieces
from starhold.certification.certificate import EXACT, EXACT_SIGN, Claim, Obligation
from starhold.certification.convergence import ALMOST
from starhold.certification.matrices import (
    Rows,
    definite,
    greatest,
    least,
    number,
    root_above,
    root_below,
    spectral_norm_above,
    symmetric_part,
)
from starhold.certification.motion import AXES, RATE, Motion, Truths
from starhold.certification.subject import Subject, above, as_tuple, below, perigee
from starhold.parts.environments.gravity_gradient import gravity_gradient

ASSUMPTIONS = (
    "rigid body",
    "inertia exactly as given",
    "exact measurement and ideal actuators",
    "torque applied continuously",
    "torque not limited",
    "torque from outside bounded on each axis",
)


@dataclass(frozen=True)
class Surface:
    """s = w + Kq with J s' = (torque from outside) - T; T_i is `reach` with the sign of s_i, within |s_i| <= layer
    proportional to it."""

    K: Rows
    reach: list[Any]
    layer: Any


def surface_claim(subject: Subject) -> Claim | None:
    """The claim; None for a law without a `surface`."""
    if not hasattr(subject.law.module, "surface"):
        return None
    motion = Motion(subject)
    obligations: list[Obligation] = []

    def add(name: str, how: str, outcome: Any, evidence: dict[str, Any] | None = None) -> None:
        obligations.append(Obligation(name, how, outcome, evidence or {}))

    torque = [exact(above(exact(above(m)) + subject.disturbance)) for m in subject.modelled]
    numbers: dict[str, Any] = {"torque": [number(m) for m in torque]}

    def finish() -> Claim:
        return Claim("sliding", numbers, {}, ASSUMPTIONS, tuple(obligations))

    try:
        found = take_surface(motion)
    except ArithmeticError as reason:
        add("form", EXACT, "undecided", {"reason": str(reason)})
        return finish()
    add("form", EXACT, "proved")
    margin = [g - m for g, m in zip(found.reach, torque, strict=True)]
    numbers["margin"] = below(min(margin))
    if min(margin) <= 0:
        axis = margin.index(min(margin))
        add("reach exceeds torque", EXACT_SIGN, *_overpowered(subject, found, axis))
        return finish()
    add("reach exceeds torque", EXACT_SIGN, "proved")
    if not definite(symmetric_part(found.K)):
        values, axes = np.linalg.eigh(np.array([[number(x) for x in row] for row in symmetric_part(found.K)]))
        axis = axes[:, 0].tolist()
        form: Any = sum(
            (exact(a) * exact(b) * k for a, row in zip(axis, found.K, strict=True) for b, k in zip(axis, row, strict=True)),
            fmpq(0),
        )
        against = {"axis": axis, "q.Kq": number(form)} if form < 0 else {"reason": f"q.Kq has the eigenvalue {values[0]:g}"}
        add("surface holds the target", EXACT_SIGN, "refuted" if form < 0 else "undecided", against)
        return finish()
    add("surface holds the target", EXACT_SIGN, "proved")
    size = _layer_bound(subject, found, torque)
    stiff = least(symmetric_part(found.K))
    turn = size / stiff
    if size > 0:
        add(
            "layer",
            EXACT_SIGN,
            "proved" if turn < 1 else "undecided",
            {} if turn < 1 else {"reason": "the layer is too thick"},
        )
    steep, cover = spectral_norm_above(found.K), subject.loop.sign_policy
    add("other equilibrium repels" if cover == "as_published" else "no switch of the quaternion sign", EXACT_SIGN, "proved")
    numbers["surface"] = above(size)
    numbers["angle"] = float((2 * arb(min(turn, fmpq(1))).asin()).upper().mid()) * (1.0 + 1e-15)
    numbers["rate"] = above(size + steep * turn)
    numbers |= {"everything": True, "start": None, "slew_angle": 2.0 * math.pi, "rate_start": None}
    if cover != "as_published":
        # While |s| < K_min the half of the double cover that is fed back is not left: there (q0)' > 0 at q0 = 0.
        start = exact(below(least(subject.inertia) * stiff * stiff / 2 * ALMOST))
        fastest = root_below(2 * start / greatest(subject.inertia))
        widest = arb(min(fastest / steep, fmpq(1)))
        numbers |= {"everything": False, "start": number(start), "rate_start": below(fastest)}
        numbers["slew_angle"] = float((2 * widest.asin()).lower().mid()) * (1.0 - 1e-15)
    return finish()


def take_surface(motion: Motion) -> Surface:
    """The surface and the switching torque; ArithmeticError where they are not of that form."""
    plain: list[Polynomial] = list(motion.subject.law.module.surface(motion.measurement, motion.gains))
    K = [[component.terms.get((name,), fmpq(0)) for name in AXES] for component in plain]
    for component, axis in zip(plain, RATE, strict=True):
        if (component.only(lambda m: not (len(m) == 1 and m[0] in AXES)) - Polynomial.variable(axis)).terms:
            raise ArithmeticError(f"the surface is not w + Kq: {component}")
    J = as_tuple(motion.subject.inertia)
    slopes = [motion.along(component) for component in plain]
    momentum = [row[0] * slopes[0] + row[1] * slopes[1] + row[2] * slopes[2] for row in J]  # type: ignore[index]
    reach: list[Any] = [fmpq(0)] * 3
    slopes_in_layer: list[Any] = [None] * 3
    for truths, parts in jointly(cast(Any, momentum)):
        for i, part in enumerate(parts):
            outside = Polynomial.variable(f"e{i + 1}") + Polynomial.variable(f"m{i + 1}")
            switched = outside - part
            value = switched.value
            if value is not None and value != 0:
                if not _side(truths, plain[i], value > 0):
                    raise ArithmeticError(f"axis {i + 1} does not switch with the sign of its surface")
                reach[i] = max(reach[i], abs(value))
                continue
            slope = switched.terms.get((RATE[i],), fmpq(0))
            if (switched - slope * plain[i]).terms or slope <= 0:
                raise ArithmeticError(f"J s' has the terms {switched}")
            slopes_in_layer[i] = slope
    if any(g == 0 for g in reach):
        raise ArithmeticError("an axis does not switch")
    layers = [_layer(motion, i, slope, g, plain[i]) for i, (slope, g) in enumerate(zip(slopes_in_layer, reach, strict=True))]
    return Surface(K, reach, max(layers))


def _side(truths: Truths, s: Polynomial, positive: bool) -> bool:
    """Whether the conditions say that s > c or s < -c for a c that is not negative."""
    for condition, truth in truths:
        if not truth:
            continue
        factor, offset = _along(condition.positive, s)
        if offset is not None and offset <= 0 and factor != 0 and (factor > 0) == positive:
            return True
    return False


def _along(polynomial: Polynomial, s: Polynomial) -> tuple[Any, Any | None]:
    """The factor and offset with which a polynomial is factor s + offset; None for an offset that is not constant."""
    first, c = next(iter(s.terms.items()))
    factor = polynomial.terms.get(first, fmpq(0)) / c
    return factor, (polynomial - factor * s).value


def _layer(motion: Motion, axis: int, slope: Any, reach: Any, s: Polynomial) -> Any:
    """The thickness at which the torque within the layer meets that outside; zero where it switches by sign."""
    thickness = reach / slope
    for case in pieces(motion.torque[axis]):
        for condition, _ in case.truths:
            factor, offset = _along(condition.positive, s)
            if offset == 0:
                return fmpq(0)
            if factor != 0 and offset is not None and abs(offset / factor) == thickness:
                return thickness
    raise ArithmeticError("the boundary layer is not where its torque meets the switching torque")


def _layer_bound(subject: Subject, found: Surface, torque: list[Any]) -> Any:
    """A bound that |s| falls below: where V = s.Js/2 may rise, each |s_i| is small, so V is, and so |s| stays."""
    phi = found.layer
    if phi == 0 or not any(torque):
        return fmpq(0)
    total = sum((phi * m * m / (4 * g) for m, g in zip(torque, found.reach, strict=True)), fmpq(0))
    squares: Any = fmpq(0)
    for m, g in zip(torque, found.reach, strict=True):
        inside = total <= (g - m) * phi
        far = phi * (m + root_above(m * m + 4 * g * total / phi)) / (2 * g) if inside else total / (g - m)
        squares += far * far
    ratio = greatest(subject.inertia) / least(subject.inertia)
    return root_above(ratio * squares)


def _overpowered(subject: Subject, found: Surface, axis: int) -> tuple[str, dict[str, Any]]:
    """A place on the orbit and a state at which the torque pushes the surface variable away."""
    loop, push, where = subject.loop, subject.disturbance, dict[str, Any]()
    if loop.has("gravity-gradient"):
        distance = number(exact(float(perigee(loop)[0].mid())))
        random = np.random.default_rng(0)
        directions = random.normal(size=(2000, 3))
        directions *= distance / np.linalg.norm(directions, axis=1, keepdims=True)
        strength = 3.0 * loop.craft.gravity / distance**5
        pushed = [gravity_gradient(tuple(d), strength, loop.craft)[axis] for d in directions.tolist()]
        place = int(np.argmax(pushed))
        push, where = push + exact(pushed[place]), {"position": directions[place].tolist()}
    # Floats told where.
    if push * (1 - fmpq(1, 10**9)) <= found.reach[axis]:
        return "undecided", {"reason": "the bound of the torque exceeds the reach, but no torque was found that does"}
    rate = [0.0, 0.0, 0.0]
    rate[axis] = 1e-3 + 2.0 * number(found.layer)
    state = {"attitude": [1.0, 0.0, 0.0, 0.0], "rate": rate}
    return "refuted", {"axis": axis + 1, "reach": number(found.reach[axis]), "torque": number(push), **where, "state": state}
