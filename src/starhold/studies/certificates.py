"""The certificates of a scenario's laws, each tried by flights; issued anew after faults that are known of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from starhold.analysis.departure import Departure, departures
from starhold.certification.certificate import Certificate
from starhold.certification.certify import Wanted, certify
from starhold.certification.region import Shape
from starhold.loop.kernels import make_step
from starhold.parts.bodies.rigid_body import kinetic_energy
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheels import gives_what_is_asked
from starhold.parts.quaternion_sign import SIGN_POLICIES
from starhold.scenario.building import build
from starhold.simulation.lane import fly

if TYPE_CHECKING:
    from starhold.analysis.trial import Trial
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.simulation.lane import Recording


class Tried(NamedTuple):
    """A certificate, the flights that tried it (None: it claims nothing that can be flown), and for each kind of claim
    about a set whether the scenario's start lies in it."""

    certificate: Certificate
    trial: Trial | None
    start_inside: dict[str, bool]


class Issued(NamedTuple):
    """A certificate, the loop, without faults to come, that it speaks of, and the control step from which on that flies."""

    certificate: Certificate
    loop: ClosedLoop
    step: int


def certify_law(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> list[Issued]:
    """The certificates of one law of the scenario, with the claims that its [certify] table asks for: as it starts, and from
    each time on at which wheels, gains or craft are others and the law knows of it."""
    table = scenario.table.certify
    wanted = Wanted(table.rate, table.slew_angle, table.inertia_tolerance, table.disturbance, table.momentum)
    found: list[Issued] = []
    for step, now in _known(loop, scenario.table.simulation.steps):
        name = f"{entry.name} from {step * loop.period:g} s" if step else entry.name
        found.append(Issued(certify(now, name, wanted), now, step))
    return found


def _known(loop: ClosedLoop, steps: int) -> list[tuple[int, ClosedLoop]]:
    """The loop as it starts, and at each control step of a run from which on it is another that the law knows."""
    found = [(0, replace(loop, events=()))]
    if loop.remembers:
        return found
    latest = {event.step: event for event in loop.events if event.step < steps}
    for step, event in latest.items():
        sound = all(gives_what_is_asked(f.params) for f in event.parts if f.part.name == "wheels")
        if not sound or event.nominal.inertia != event.craft.inertia:
            continue
        now = replace(loop, events=(), craft=event.craft, gains=event.gains, parts=event.parts)
        if step:
            # A step more, for what the event changes at once.
            carry = fly(loop, step)[1]
            phase = next(phase for phase in loop.phases(steps) if phase.first == step)
            carry = phase.entered(carry)
            moving = zip(now.used("effector"), carry.effectors, strict=True)
            now = replace(now, start=carry.state).with_parts(*(replace(f, start=own) for f, own in moving))
            if loop.target.part.name == "history":
                table = loop.target.params.table[step:]
                now = now.with_parts(replace(loop.target, params=loop.target.params._replace(table=table)))
        found = [(step, now)] if step == 0 else [*found, (step, now)]
    return found


def departures_of(issued: Issued, loop: ClosedLoop, run: Recording) -> dict[str, tuple[Departure, ...]]:
    """How the run of a loop leaves the claims of one of its certificates, which ends where the loop changes next."""
    last = min((event.step for event in loop.events if event.step > issued.step), default=None)
    within = last is not None and last * loop.period <= float(run["time"][-1])
    return departures(issued.certificate, issued.loop, run, issued.step, last if within else None)


def certify_scenario(scenario: Scenario, law: str | None = None) -> list[Tried]:
    """Certificates of all laws of a scenario, or of one. Raises `BrokenClaimError` where a flight contradicts one."""
    entries = scenario.laws if law is None else (scenario.pick(law),)
    # Loaded here, for flights do without.
    from starhold.analysis.trial import fly_claims

    # All of them before the first proof, so that what is wrong with the last is said at once.
    loops = [build(scenario, entry) for entry in entries]
    issued = [found for entry, loop in zip(entries, loops, strict=True) for found in certify_law(scenario, entry, loop)]
    return [
        Tried(found.certificate, fly_claims(found.loop, found.certificate), start_inside(*found[:2])) for found in issued
    ]


def start_inside(certificate: Certificate, loop: ClosedLoop) -> dict[str, bool]:
    """Whether the loop's start lies in the sets of the proved claims that are about a level of V."""
    if loop.remembers:
        return {}
    # The true start, whatever the sensors make of it.
    loop = loop.without("sensor", "estimator")
    measurement = make_step(loop.composition()).measure(loop.carry(), 0, 0, loop.craft, loop.setup())
    shown = measurement._replace(
        attitude=SIGN_POLICIES[loop.sign_policy](measurement.attitude, loop.carry().h, loop.hysteresis_width)[0]
    )
    total = tensor(loop.craft.inertia) @ measurement.body_rate + np.array(measurement.wheel_momentum)
    function, found = loop.law.lyapunov, dict[str, bool]()
    for claim in certificate.claims:
        if claim.outcome != "proved":
            continue
        if claim.kind == "region":
            a = cast(float, loop.law.module.single_root(loop.gains)[0])
            found[claim.kind] = bool(Shape(**claim.witness).value(a, shown.attitude, shown.rate) <= claim.numbers["level"])
        elif function is not None and "start" in claim.numbers:
            level, stiffness = claim.numbers["start"], claim.witness.get("stiffness")
            value = function(shown, loop.gains, loop.craft)
            if stiffness is not None:
                value = kinetic_energy(shown.rate, loop.craft) + 2.0 * stiffness * (1.0 - shown.attitude[0])
            held = float(np.linalg.norm(total)) <= claim.numbers.get("momentum", np.inf)
            found[claim.kind] = held and (level is None or value <= level)
    return found
