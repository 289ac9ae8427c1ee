"""Tests the equations of the publication numerically."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra import vector
from starhold.algebra.quaternion import derivative, to_body
from starhold.analysis.rigid_body import error_angle
from starhold.parts.craft import tensor
from starhold.parts.environments.gravity_gradient import gravity_gradient
from starhold.publications.desk import Desk
from starhold.publications.verdicts import Finding
from starhold.simulation.lane import fly

Array = NDArray[np.float64]
COMMON = "three-laws"


def skew(a: Any) -> Array:
    """Return the cross-product matrix [a]x (3, 3) of a (3,)."""
    return np.array(vector.skew(a))


def near_the_target(desk: Desk, degrees: float = 1.0) -> Finding:
    """Return for both signs of Q whether the Lyapunov law takes the shorter rotation from rest near the target."""
    half = np.radians(degrees) / 2.0
    verdicts: dict[str, bool] = {}
    notes: list[str] = []
    for name, sign in (("q0 > 0", 1.0), ("q0 < 0 at the same attitude", -1.0)):
        start = [sign * np.cos(half), sign * np.sin(half), 0.0, 0.0]
        changes = {"initial.attitude": start, "initial.rate": [0.0, 0.0, 0.0]}
        angle = np.degrees(error_angle(desk.recording(COMMON, "lyapunov", changes)["attitude_error"]))
        verdicts[name] = bool(angle.max() < 2.0 * degrees)
        notes.append(f"{name}: at most {angle.max():.0f} degrees off on the way")
    return Finding(verdicts, "; ".join(notes))


def target_motion(desk: Desk, cases: int = 100) -> Finding:
    """Return the largest relative errors of the two formulas (10) over random motions of a target: of the rate computed from
    the vector part as printed, and of the acceleration computed from E."""
    random: Any = np.random.default_rng(1)
    printed: list[float] = []
    by_e: list[float] = []
    for _ in range(cases):
        q, rate, acceleration = random.normal(size=4), random.normal(size=3), random.normal(size=3)
        q /= np.linalg.norm(q)
        first: Any = np.array(derivative(q, rate))
        second = np.add(derivative(first, rate), derivative(q, acceleration))
        block = q[0] * np.eye(3) + skew(q[1:])
        # E has the scalar part last.
        e = np.vstack([block, -q[1:]])
        printed.append(float(np.linalg.norm(2.0 * block @ first[1:] - rate) / np.linalg.norm(rate)))
        by_formula = 2.0 * e.T @ np.array([*second[1:], second[0]])
        by_e.append(float(np.linalg.norm(by_formula - acceleration) / np.linalg.norm(acceleration)))
    note = f"off by up to {max(printed):.1g} times the rate, and {max(by_e):.0e} times the acceleration"
    return Finding({"rate": max(printed) < 1e-9, "acceleration": max(by_e) < 1e-9}, note)


def on_the_surface(desk: Desk, cases: int = 2000) -> Finding:
    """Return whether V_e' = q'K q' is negative on the surface w = -K q, at random attitudes with either sign of q0, and at
    the published start."""
    gain = desk.scenario(COMMON).pick("sliding").gains.surface_gain[0]
    random = np.random.default_rng(2)
    attitudes = random.normal(size=(cases, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1)[:, None]

    def slope(q: Any) -> float:
        return float(gain * q[1:] @ derivative(q, -gain * q[1:])[1:])

    start = np.array([0.0, 1.0, 1.0, 1.0]) / np.sqrt(3.0)
    verdicts = {
        "q0 > 0": all(slope(q) < 0.0 for q in attitudes if q[0] > 0.0),
        "q0 = 0 as at the published start": slope(start) < -1e-12,
        "q0 < 0": all(slope(q) < 0.0 for q in attitudes if q[0] < 0.0),
    }
    return Finding(verdicts, f"V_e' = {slope(start):.1g} at the published attitude")


def reaching_condition(desk: Desk, cases: int = 2000) -> Finding:
    """Return whether V_r' = s (M - g sign s) <= 0 for random s and M that satisfy the condition (21): as printed, and with
    |M|."""
    random = np.random.default_rng(3)
    s, torque = random.normal(size=cases), random.normal(size=cases)
    bound = random.uniform(0.0, 2.0, size=cases)
    falls = s * (torque - bound * np.sign(s)) <= 0.0
    return Finding(
        {"g >= |M|": bool(falls[bound >= np.abs(torque)].all()), "g >= M as printed": bool(falls[bound >= torque].all())}
    )


def gravity_block(desk: Desk, cases: int = 20) -> Finding:
    """Return the factor missing in the gravity block of the printed matrix: the derivative of the torque with respect to the
    vector part of a small turn, compared with (mu/R^5) ([R]J - [JR]) [R] at random attitudes."""
    craft = desk.loop(COMMON, "mpc").craft
    moments, random = tensor(craft.inertia), np.random.default_rng(4)
    factors: list[float] = []
    for _ in range(cases):
        place: Any = tuple(7.0e6 * (lambda v: v / np.linalg.norm(v))(random.normal(size=3)))
        strength = 3.0 * craft.gravity / 7.0e6**5

        def torque(turn: Array, place: Any = place, strength: float = strength) -> Array:
            quaternion: Any = (float(np.sqrt(1.0 - turn @ turn)), *map(float, turn))
            return np.array(gravity_gradient(to_body(quaternion, place), strength, craft))

        step = 1e-4
        slopes = np.column_stack([(torque(step * e) - torque(-step * e)) / (2.0 * step) for e in np.eye(3)])
        r = np.array(place)
        printed = craft.gravity / 7.0e6**5 * (skew(r) @ moments - skew(moments @ r)) @ skew(r)
        factors.append(float((slopes * printed).sum() / (printed**2).sum()))
    return Finding(float(np.mean(factors)), f"from {min(factors):.6f} to {max(factors):.6f} at {cases} places")


def one_step(desk: Desk, of: Mapping[str, Mapping[str, Any]]) -> Finding:
    """Return whether x + h (A_c x + B u) predicts the state (q; w) one control period later under predictive control, to
    within a tenth of its change. of: cases by name, with `step`, the h (the control period, or 1 as printed), and
    `changes`."""
    errors: dict[str, float] = {}
    for name, case in of.items():
        loop = desk.loop(COMMON, "mpc", case.get("changes"))
        end, inertia = fly(loop, 1)[1], tensor(loop.craft.inertia)
        before, after = (np.array([*state.attitude[1:], *state.rate]) for state in (loop.start, end.state))
        rate, control = before[3:], np.array(end.command)
        damping = skew(inertia @ rate) - skew(rate) @ inertia
        # The gravity block is six orders smaller.
        slope = np.block([[-skew(rate), 0.5 * np.eye(3)], [np.zeros((3, 3)), np.linalg.solve(inertia, damping)]]) @ before
        slope[3:] += np.linalg.solve(inertia, control)
        predicted = before + (loop.period if case["step"] else 1.0) * slope
        errors[name] = float(np.linalg.norm(predicted - after) / np.linalg.norm(after - before))
    note = "error as a share of the state's change: " + ", ".join(f"{name} {off:.2g}" for name, off in errors.items())
    return Finding({name: error < 0.1 for name, error in errors.items()}, note)
