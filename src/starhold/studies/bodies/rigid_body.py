"""The study of a rotating body, with or without wheels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, final

from starhold.algebra.quantity import Quantity
from starhold.analysis.meter import recorded_of, says_valid
from starhold.analysis.premise_notes import MODES, PREMISES, Masses
from starhold.analysis.rigid_body import EXTRAS, METRICS, error_angle, make_meter, measure
from starhold.analysis.transient import Limits, against_limits
from starhold.laws.modes import mode_laws
from starhold.loop.modes import loop_of_mode
from starhold.parts.epoch import OF_DATE, iso_text
from starhold.parts.part import same_numbers
from starhold.scenario.bodies.rigid_body.start import date_of_axes
from starhold.simulation.lane import fly
from starhold.studies.body import NO_CONES, BodyStudy, Cones, Issued
from starhold.studies.modes import (
    Stretch,
    begins_asked,
    certify_modes,
    first_fault,
    flown_stretches,
    hand_overs,
    mode_departures,
    named_modes,
    parts_asked,
)

if TYPE_CHECKING:
    from starhold.analysis.departure import Departure
    from starhold.analysis.meter import Meter
    from starhold.analysis.ranking import MetricSet
    from starhold.certification.certify import Wanted
    from starhold.certification.hand_over import Ends
    from starhold.loop.closed_loop import ClosedLoop, Event
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.simulation.lane import Recording

TRANSIENT = ("rate_limit", "acceleration_limit", "angle_end", "rate_end")


@final
class RigidBodyStudy(BodyStudy):
    """Everything is in SI. Laws with wheels are certified again after faults that they know of."""

    EXTRAS = EXTRAS
    CLAIMS, TRIALS = "starhold.analysis.departure", "starhold.analysis.trial"

    def name_samples(self, scenario: Scenario, loop: ClosedLoop, samples: Any, carry: Any) -> Recording:
        settling, transient = scenario.table.settling, scenario.table.transient
        described = {f"settling_{name}": getattr(settling, name) for name in ("attitude_tolerance", "rate_tolerance")}
        if transient is not None:
            described |= {f"transient_{name}": getattr(transient, name) for name in TRANSIENT}
        orbit, of_date = scenario.table.orbit, date_of_axes(scenario)
        if orbit is not None and orbit.epoch is not None:
            described["epoch"] = iso_text(orbit.epoch)
        if of_date is not None:
            described |= {"epoch": iso_text(of_date), "frame": OF_DATE}
        run = super().name_samples(scenario, loop, samples, carry)
        angle = {"error_angle": error_angle(run["attitude_error"])}
        meant = {"error_angle": Quantity("rad", "angle to the target")}
        attrs = run.attrs | described | {"seed": scenario.table.simulation.seed}
        return replace(run, arrays=run.arrays | angle, columns=run.columns | meant, attrs=attrs)

    def metrics_of(self, run: Recording) -> dict[str, Any]:
        attrs = run.attrs
        tolerances = attrs["settling_attitude_tolerance"], attrs["settling_rate_tolerance"]
        if "transient_angle_end" not in attrs:
            return measure(run, *tolerances)
        rate, acceleration, *ends = (attrs[f"transient_{name}"] for name in TRANSIENT)
        return against_limits(run, Limits(rate, acceleration), measure(run, *tolerances, transient=(ends[0], ends[1])))

    def measure_required(self, run: Recording, cones: Cones) -> dict[str, Any]:
        attrs = run.attrs
        return measure(run, attrs["settling_attitude_tolerance"], attrs["settling_rate_tolerance"], cones)

    def meter(
        self, scenario: Scenario, loop: ClosedLoop, gains: Any, extras: Sequence[str] = (), cones: Cones = NO_CONES
    ) -> Meter:
        masses = None
        if PREMISES in extras:
            masses = Masses(
                loop.craft.inertia, loop.wheel_axes, (0.0,) * len(MODES) if mode_laws(loop.law, loop.gains) else ()
            )
        for extra in extras:
            if extra not in (*EXTRAS, PREMISES):
                raise ValueError(f"{' or '.join(EXTRAS)}, not {extra}")
        settling = scenario.table.settling
        tolerances = settling.attitude_tolerance, settling.rate_tolerance
        steps, still = scenario.table.simulation.steps, loop.target.part.flag("STILL")
        wheels = "wheel_momentum" in recorded_of(loop)
        more: Any = {"begins": begins_asked(scenario, loop.law), "fault": first_fault(scenario, loop)}
        more["estimated"] = says_valid(loop.composition())
        more |= {"spans": parts_asked(scenario, loop.law), "masses": masses}
        return make_meter(steps, loop.period, loop.limit, tolerances, extras, cones, still=still, wheels=wheels, **more)

    def metric_set(self, run: Recording) -> MetricSet:
        return METRICS

    def state_names(self, run: Recording) -> tuple[str, ...]:
        wheels = ("wheel_momentum",) if "wheel_momentum" in run.arrays else ()
        return ("attitude", "rate", "position", "velocity", *wheels)

    def compile_calls(self, loop: ClosedLoop) -> None:
        from starhold.analysis.cost import compile_calls

        compile_calls(loop)

    def call_costs(self, loop: ClosedLoop, run: Recording) -> dict[str, float]:
        from starhold.analysis.cost import call_costs, recorded_states

        return call_costs(loop, recorded_states(loop, run))

    def certify(self, scenario: Scenario, entry: LawEntry, loop: ClosedLoop, pointing: bool = False) -> list[Issued]:
        return certify_law(scenario, entry, loop, pointing)

    def departures(self, issued: Issued, loop: ClosedLoop, run: Recording) -> dict[str, tuple[Departure, ...]]:
        from starhold.analysis.departure import departures

        end = self.ends(issued, loop, float(run["time"][-1]))
        if issued.mode is not None:
            return mode_departures(issued, run, end)
        return departures(issued.certificate, issued.loop, run, issued.step, end)

    def covered(self, issued: Issued, loop: ClosedLoop, run: Recording) -> tuple[tuple[float, float], ...]:
        from starhold.analysis.departure import covered

        end = self.ends(issued, loop, float(run["time"][-1]))
        flown = [Stretch(0, issued.step, end)] if issued.mode is None else flown_stretches(issued, run, end)
        every = (covered(issued.certificate, issued.loop, run, one.first, one.last) for one in flown)
        return tuple(between for between in every if between is not None)

    def ends(self, issued: Issued, loop: ClosedLoop, time: float) -> int | None:
        # A certificate applies until the loop changes; of several events at one step the last one decides.
        latest = {event.step: event for event in loop.events if event.step * loop.period <= time}
        return min((step for step, event in latest.items() if _differs(event, issued, loop)), default=None)

    def start_inside(self, issued: Issued) -> dict[str, bool]:
        begins = issued.mode is None or (issued.mode == 1 and issued.before is None and not issued.step)
        return super().start_inside(issued) if begins else {}


STUDY = RigidBodyStudy()


def _differs(event: Event, issued: Issued, flown: ClosedLoop) -> bool:
    """Return whether the true loop, or the law's model of it, differs after an event from the loop that a certificate is
    about."""
    if event.step != issued.step or issued.step:
        return event.step > issued.step
    # A fault at the very start, known to the law or not.
    loop, after = issued.loop, flown.after(event)
    after = after if issued.mode is None else loop_of_mode(after, issued.mode - 1)
    pairs = zip(after.parts, loop.parts, strict=True)
    same = same_numbers((event.craft, event.nominal, after.gains), (loop.craft, loop.craft, loop.gains))
    return not (same and all(same_numbers(one.params, other.params) for one, other in pairs))


def certify_law(scenario: Scenario, entry: LawEntry, loop: ClosedLoop, pointing: bool = False) -> list[Issued]:
    """Return the certificates of one law of the scenario, with the claims of its [certify] table: for the initial loop, and
    for the loop after each change of wheels, gains or craft that the law knows of."""
    from starhold.certification.certify import certify

    wanted = wanted_of(scenario, pointing)
    if mode_laws(loop.law, loop.gains):
        from starhold.studies.chain import widened

        issued = list[Issued]()
        for name, now, step in named_loops(scenario, entry, loop):
            modes = certify_modes(now, name, wanted)
            modes = widened(now, name, modes, wanted) if pointing else modes
            issued += [one._replace(step=step) for one in modes]
        return issued
    return [Issued(certify(now, name, wanted), now, step) for name, now, step in named_loops(scenario, entry, loop)]


def wanted_of(scenario: Scenario, pointing: bool) -> Wanted:
    """Return the claims that a scenario's [certify] table asks for; pointing: whether to add the proved pointing bound."""
    from starhold.certification.certify import Wanted

    table = scenario.table.certify
    return Wanted(
        table.rate, table.slew_angle, table.inertia_tolerance, table.disturbance, table.momentum, pointing=pointing
    )


def certified_loops(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> dict[str, ClosedLoop]:
    """Return the loops of the certificates of one law of the scenario, by name."""
    every = {name: now for name, now, _ in named_loops(scenario, entry, loop)}
    if not mode_laws(loop.law, loop.gains):
        return every
    modes = [one for name, now in every.items() for one in named_modes(now, name).items()]
    return dict(modes) | {one.name: one.after for name, now in every.items() for one in hand_overs(now, name)}


def handed_over(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> dict[str, Ends]:
    """Return the rates (rad/s) and angles (rad) below which the switches of a law hand over to the next mode, by the names
    of their certificates."""
    from starhold.certification.hand_over import ends

    every = named_loops(scenario, entry, loop) if mode_laws(loop.law, loop.gains) else []
    switches = [one for name, now, _ in every for one in hand_overs(now, name)]
    return {one.name: ends(one.levels, one.before, one.after) for one in switches}


def named_loops(scenario: Scenario, entry: LawEntry, loop: ClosedLoop) -> list[tuple[str, ClosedLoop, int]]:
    """Return the initial loop and each later loop that the law knows, with the begin of their certificates' names and the
    control step from which they fly."""
    known = _known(loop, scenario.table.simulation.steps)
    return [(f"{entry.name} from {step * loop.period:g} s" if step else entry.name, now, step) for step, now in known]


def _known(loop: ClosedLoop, steps: int) -> list[tuple[int, ClosedLoop]]:
    """Return the initial loop and each later loop that the law knows, with the control step at which it begins."""
    known = [(0, replace(loop, events=()))]
    # A law that goes on with its memory does not begin anew; each mode does.
    if loop.remembers and not mode_laws(loop.law, loop.gains):
        return known
    latest = {event.step: event for event in loop.events if event.step < steps}
    for step, event in latest.items():
        sound = all(tells(f.params) for f in event.parts if (tells := f.part.hook("gives_allocated_torque")) is not None)
        if not sound or event.nominal.inertia != event.craft.inertia:
            continue
        now = loop.after(event)
        if step:
            # One more step, for changes at the event itself.
            carry = fly(loop, step)[1]
            phase = next(phase for phase in loop.phases(steps) if phase.first == step)
            carry = phase.entered(carry)
            moving = zip(now.used("effector"), carry.effectors, strict=True)
            now = replace(now, start=carry.state).with_parts(*(replace(f, start=state) for f, state in moving))
            if loop.target.part.name == "history":
                table = loop.target.params.table[step:]
                now = now.with_parts(replace(loop.target, params=loop.target.params._replace(table=table)))
        known = [(step, now)] if step == 0 else [*known, (step, now)]
    return known
