"""The checks for attitude laws of a rigid body."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice, tee
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import multiply, normalise, stretch, to_reference
from starhold.algebra.structure import move
from starhold.algebra.vector import ZERO
from starhold.analysis.cost import call_costs
from starhold.analysis.rigid_body import measure
from starhold.analysis.trial import fly_claims
from starhold.certification.certify import certify
from starhold.conformance.bench import CRAFT, call, random_measurements, random_quaternions, sample_loop
from starhold.conformance.bodies.any_body import survives_toml
from starhold.conformance.units import SYSTEMS, rescaled, times
from starhold.conformance.verdicts import STEPS, NotApplicableError, agree, declares_itself, gives_reasons, require
from starhold.laws.catalogue import Law, catalogue
from starhold.laws.interface import Measurement
from starhold.loop.closed_loop import ClosedLoop
from starhold.loop.kernels import make_step
from starhold.parts.bodies.rigid_body import State
from starhold.parts.catalogue import PACKAGES, fit, parts, telling
from starhold.parts.contract import GIVEN
from starhold.parts.part import Fitted, Part
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.scenario.writing import scenario_with
from starhold.simulation.lane import fly, label

FEW = 16
"""Number of flights that test a certificate."""
ON_TARGET = Measurement((1.0, 0.0, 0.0, 0.0), ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.1)


def loop_with(part: Part, params: Any) -> ClosedLoop:
    """Return a loop with a part and the parts that it needs."""
    law = catalogue()["lyapunov"]
    loop = sample_loop(law, law.examples()[0])
    if part.role == "target":
        loop = loop.without("target")
    fitted = Fitted(part, params)
    needs = () if part.role == "estimator" else fitted.needs
    others = [one for role in PACKAGES for one in parts(role).values() if one.name in needs and not loop.has(one.name)]
    loop = loop.with_parts(*(Fitted(one, one.examples()[0]) for one in others))
    try:
        loop = loop.with_parts(*telling(fitted.needs if part.role == "estimator" else part.reads))
    except LookupError as error:
        raise NotApplicableError(str(error)) from None
    return loop.with_parts(fitted)


def is_pure(law: Law) -> None:
    """The torque depends on nothing but its arguments."""
    for gains in law.examples():
        for measurement in random_measurements(10):
            require(call(law, measurement, gains) == call(law, measurement, gains), f"two calls differ at {measurement}")


def reads_alike(law: Law) -> None:
    """Plain Python, one lane and every lane of a batch agree bit for bit."""
    for gains in law.examples():
        loop = sample_loop(law, gains)
        # The other lanes with the same start draw other random numbers for their sensors.
        lanes = (0,) if _senses(law) else (0, 2)
        agree(loop, [replace_rate(loop.start, factor) for factor in (1.0, 0.5, 1.0, 2.0)], lanes)


def _senses(law: Law) -> bool:
    """Return whether the law needs the reading of a sensor."""
    return not {*law.reads} <= {*GIVEN}


def replace_rate(state: Any, factor: float) -> Any:
    """Return the state with its rate multiplied by a factor."""
    return state._replace(rate=tuple(factor * w for w in state.rate))


def rests_on_target(law: Law) -> None:
    """The torque is zero at rest on target."""
    for gains in law.examples():
        torque = call(law, ON_TARGET, gains)
        size = float(np.abs(torque).max())
        require(size <= law.card.rest_tolerance, f"torque {size:g} N m at rest on target")


def treats_quaternion_sign_as_stated(law: Law) -> None:
    """The torques at q and -q agree or differ as the card states."""
    for gains in law.examples():
        differences: list[float] = []
        for measurement in random_measurements(20):
            other = measurement._replace(attitude=stretch(-1.0, measurement.attitude))
            differences.append(float(np.abs(np.subtract(call(law, measurement, gains), call(law, other, gains))).max()))
        if law.card.quaternion_sign == "even":
            require(max(differences) < 1e-12, f"q and -q differ by {max(differences):g} N m, the card says they do not")
        else:
            require(max(differences) > 1e-12, "q and -q never differ, the card says they do")


def ignores_inertial_frame(law: Law) -> None:
    """Turning the inertial frame changes nothing."""
    if _senses(law):
        raise NotApplicableError("what it reads is fixed in inertial axes")
    for gains, turn in zip(law.examples(), random_quaternions(len(law.examples())), strict=True):
        loop = sample_loop(law, gains)
        s = loop.start
        turned = s._replace(
            attitude=normalise(multiply(turn, s.attitude)),
            position=to_reference(turn, s.position),
            velocity=to_reference(turn, s.velocity),
        )
        goal = fit("target", "inertial", normalise(multiply(turn, loop.target.params.attitude)))
        other = replace(loop.with_parts(goal), start=turned)
        rows = slice(13, 16)
        difference = np.abs(fly(loop, STEPS)[0][rows] - fly(other, STEPS)[0][rows]).max()
        require(difference <= 1e-9, f"the torque changes by {difference:g} N m")


def stays_finite(law: Law) -> None:
    """The torque is finite at half turns, at zero error and at rest."""
    halves = [(0.0, *axis) for axis in ((1.0, 0.0, 0.0), (0.0, 0.6, -0.8), (1 / math.sqrt(3.0),) * 3)]
    for gains in law.examples():
        for attitude in [(1.0, 0.0, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0), *halves]:
            for rate in (ZERO, (0.1, -0.2, 0.05)):
                measurement = ON_TARGET._replace(attitude=attitude, rate=rate, body_rate=rate)
                require(bool(np.isfinite(call(law, measurement, gains)).all()), f"not finite at {attitude}, rate {rate}")


def keeps_units(law: Law) -> None:
    """The declared units are right: the torque is the same in any system of units."""
    for gains in law.examples():
        plain = _torques(law, gains)
        calls = len(MOTIONS)
        for changed in _changed(law, gains):
            plain, again = tee(plain)
            calls = max(calls, _first_effect(again, _torques(law, changed)))
        torques = np.array(list(islice(plain, calls)))
        size = max(float(np.abs(torques).max()), 1e-9)
        for system in SYSTEMS:
            others = np.array(list(islice(_torques(law, gains, system), calls)))
            error = float(np.abs(others - torques).max()) / size
            require(error < 1e-6, f"with kg, m, s scaled by {system} the torque changes by {error:.1e} of itself")


def _near(seen: Measurement, share: float) -> Measurement:
    """Return a measurement near the target: this share of another's error and rates."""
    _, *error = seen.attitude
    x, y, z, *rates = [share * number for number in (*error, *seen.rate, *seen.body_rate)]
    return seen._replace(attitude=normalise((1.0, x, y, z)), rate=tuple(rates[:3]), body_rate=tuple(rates[3:]))


MOTIONS = (*random_measurements(5), *map(_near, random_measurements(3), (0.1, 1e-2, 1e-3)))
"""Measurements far from the target, and in boundary layers about it."""
HOLDS = (1, 4, 16, 64, 256)
"""Calls with each measurement in successive rounds, as long as a gain has changed nothing."""


def _torques(law: Law, gains: Any, system: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Iterator[NDArray[np.float64]]:
    """Yield the torques (3,), in N m, of successive calls in a system of units; the law's memory carries over."""
    memory: Any = None
    for hold in HOLDS:
        for motion in MOTIONS:
            seen, scaled, craft, back = rescaled(law, motion, gains, CRAFT, system)
            for _ in range(hold):
                memory = law.remember(scaled, craft, seen.period) if memory is None else memory
                torque, memory = law.command(seen, scaled, craft, memory)
                yield np.array(torque) * back


def _changed(law: Law, gains: Any) -> Iterator[Any]:
    """Yield gains with one number that has a unit increased by half, one at a time."""
    for place, (item, value) in enumerate(zip(law.fields(), gains, strict=True)):
        if not (item.gain.choices or item.gain.whole):
            yield law.gains(*gains[:place], times(value, 1.5), *gains[place + 1 :])


def _first_effect(torques: Iterator[NDArray[np.float64]], others: Iterator[NDArray[np.float64]]) -> int:
    """Return the number of calls until torques differ by as much as with a wrong unit; 0 if they never do."""
    size = 1e-9
    for number, (one, other) in enumerate(zip(torques, others, strict=True), 1):
        size = max(size, float(np.abs(one).max()))
        if np.abs(other - one).max() > 1e-4 * size:
            return number
    return 0


def decreases_lyapunov(law: Law) -> None:
    """V is positive and non-increasing, at random states, for a body free of other torques."""
    if law.lyapunov is None:
        raise NotApplicableError("the law has no `lyapunov`")
    if law.card.claims == "none":
        raise NotApplicableError("the card claims nothing")
    for gains in law.examples():
        require(abs(law.lyapunov(ON_TARGET, gains, CRAFT)) < 1e-15, "V is not zero at rest on target")
        for measurement in random_measurements(300, external=False):
            value = law.lyapunov(measurement, gains, CRAFT)
            require(value > 0.0, f"V = {value:g} at {measurement}")
            slope = _slope(law, measurement, gains)
            require(slope <= 1e-7 * value, f"dV/dt = {slope:g} at {measurement}")


def can_be_certified(law: Law) -> None:
    """The certifier reads the law, or says what it cannot read."""
    for gains in law.examples():
        plain = sample_loop(law, gains)
        for loop in (
            plain.without("target").with_parts(fit("target", "orbital")),
            replace(plain, limit="norm", sign_policy="as_published"),
        ):
            gives_reasons(certify(loop))


def flies_a_scenario(law: Law) -> None:
    """It flies from a scenario file, is measured, timed and certified, and flights do not contradict proved claims."""
    for gains in law.examples():
        scenario = parse(scenario_with(law, gains), law.name)
        loop = build(scenario, scenario.laws[0])
        samples, carry = fly(loop, STEPS)
        recording = label(loop, samples, carry, 1)
        measured = measure(recording, 1e-3, 1e-3)
        require(measured["diverged_at"] is None, f"the motion is lost after {measured['diverged_at']} s")
        # Timing records a kernel of its own.
        if gains == law.examples()[0]:
            require(call_costs(loop, samples, calls=100)["cost_median"] >= 0.0, "a call cannot be timed")
        certificate = certify(loop, law.name)
        gives_reasons(certificate)
        fly_claims(loop, certificate, flights=FEW)


def _slope(law: Law, measurement: Measurement, gains: Any) -> float:
    """Return dV/dt along the closed loop, by a central difference."""
    state = State(measurement.attitude, measurement.rate, ZERO, ZERO, call(law, measurement, gains))
    loop = ClosedLoop(CRAFT, law, gains, state, measurement.period)
    turning, rates, *_ = make_step(loop.composition()).slope(loop.carry(), CRAFT, loop.setup())[0]
    function = law.lyapunov
    assert function is not None

    def value(h: float) -> float:
        rate = move(measurement.rate, h, rates)
        moved = measurement._replace(attitude=move(measurement.attitude, h, turning), rate=rate, body_rate=rate)
        return function(moved, gains, CRAFT)

    return (value(1e-4) - value(-1e-4)) / 2e-4


CHECKS: tuple[Callable[[Law], None], ...] = (
    declares_itself,
    is_pure,
    reads_alike,
    rests_on_target,
    treats_quaternion_sign_as_stated,
    ignores_inertial_frame,
    stays_finite,
    survives_toml,
    keeps_units,
    decreases_lyapunov,
    can_be_certified,
    flies_a_scenario,
)
