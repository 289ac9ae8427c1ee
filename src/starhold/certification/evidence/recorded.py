"""A closed loop in the kernel's terms: the programs that fly, its exact numbers, claims about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import inf, isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from starhold.algebra.quaternion import derivative, vector_part
from starhold.algebra.vector import apply, dot, scale
from starhold.certification.appendages import appendages, appended_motion
from starhold.certification.evidence.finding import NotFoundError, Theorem, by_digests, complete, read, unproved
from starhold.certification.evidence.shapes import Shape
from starhold.certification.matrices import above
from starhold.certification.measured import driven_errors
from starhold.certification.subject import Subject
from starhold.kernel.loops import HYSTERESIS, MOVING, OUTSIDE, REMEMBERS, SHORTEST, WHEELS, AttitudeLoop
from starhold.kernel.plans import PLANNED
from starhold.kernel.polynomials import Poly, var
from starhold.kernel.programs import Program, digest
from starhold.kernel.theorems.noise import CARRIED, CORRECTED
from starhold.laws import program
from starhold.laws.interface import Measurement
from starhold.laws.predictive.free import Plan
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies import rigid_body
from starhold.parts.craft import tensor
from starhold.parts.effectors.wheel_motion import at_top_speed
from starhold.parts.effectors.wheels import BAND
from starhold.trace.straight_line import labelled, straight_line

V3, Q4 = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
FULL = (V3, V3, V3)
NOWHERE: dict[str, int] = dict.fromkeys(("q0", "q1", "q2", "q3", "w1", "w2", "w3"), 0)
ASKED = program.ASKED["rigid-body"]
TURNS = [(-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
"""The other quaternion of the target, and half turns."""
WRITTEN: dict[str, float | None] = {"stiffness": None, "epsilon": 0.0, "rho": 0.0, "rate_bound": None}
"""The numbers of a V that is the law's own."""


@dataclass
class RecordedLoop:
    """The programs and numbers of a closed loop, and the claims that were found."""

    known: Subject
    programs: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    claims: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    written_by: dict[str, dict[str, float | None]] = field(default_factory=dict[str, dict[str, float | None]])
    """The numbers of a V that is not the law's own, by its digest."""
    forms: dict[str, Poly] = field(default_factory=dict[str, Poly])
    """The polynomials V, by their digests."""
    eigenvalues: list[list[float]] = field(default_factory=list[list[float]])
    """Those of a step near rest, in floats."""
    pushed_at: list[float] | None = None
    """The position (m) on the orbit where the gravity gradient pushes the motion off the law's surface."""

    @property
    def loop(self) -> ClosedLoop:
        """The loop that the claims are about."""
        return self.known.loop

    @property
    def plant(self) -> Any:
        """The craft with a full inertia."""
        return self.loop.craft._replace(inertia=FULL, inverse_inertia=FULL)

    @cached_property
    def plan(self) -> Plan | None:
        """Return what the law plans, or None."""
        tell: Any = self.loop.law.hook("plan")
        return None if tell is None else tell(self.loop.gains, self.loop.known, self.loop.period)

    @cached_property
    def roles(self) -> dict[str, str]:
        """The digests of the programs that every claim is about."""
        loop, driven = self.loop, driven_errors(self.loop)
        if self.plan is None:
            law = program.law_program(loop.law, loop.gains, loop.known, loop.period, loop.remembers)
        else:
            law = program.planned_program(self.plan, loop.known)
        programs = {
            "law": self.keep(law),
            "body": self.add(rigid_body.angular_acceleration, rate=V3, torque=V3, craft=self.plant),
            "turning": self.add(derivative, q=Q4, rate=V3),
        }
        if appendages(loop):
            programs["motion"] = self.keep(appended_motion(loop))
        if driven is not None:
            errors, noise = (V3,) * driven.recursion.size, (V3,) * driven.recursion.noises
            programs[CARRIED] = self.add(driven.recursion.carried, errors=errors, noise=noise)
            programs[CORRECTED] = self.add(driven.recursion.corrected, errors=errors, noise=noise)
        return programs

    def add(self, equation: Callable[..., Any], **given: Any) -> str:
        """Record a program, and return its digest."""
        return self.keep(straight_line(equation, **given))

    def keep(self, program: dict[str, Any]) -> str:
        """Take a program, and return its digest."""
        self.programs.append(program)
        return digest(program)

    def lyapunov(self, stiffness: float | None = None) -> str:
        """Record V: the law's own, or the kinetic energy and 2 stiffness (1 - q0)."""
        loop = self.loop
        if stiffness is None:
            declared = self.add(loop.law.lyapunov, measurement=ASKED, gains=loop.gains, craft=self.plant)  # pyright: ignore
            self.written_by[declared] = WRITTEN
            return declared

        def energy(measurement: Measurement, craft: Any) -> Any:
            return rigid_body.kinetic_energy(measurement.rate, craft) + 2.0 * stiffness * (1.0 - measurement.attitude[0])

        digest_of = self.add(energy, measurement=ASKED, craft=self.plant)
        self.written_by[digest_of] = WRITTEN | {"stiffness": stiffness}
        return digest_of

    def crossed(self, s: float | None, epsilon: float) -> str:
        """Record V = w.Jw/2 + 2 s (1 - q0) + epsilon q.Jw, or without s the law's own V and epsilon q.Jw."""
        loop = self.loop

        def energy(measurement: Measurement, craft: Any, gains: Any = None) -> Any:
            lean = dot(vector_part(measurement.attitude), apply(craft.inertia, measurement.rate))
            if s is None:
                return loop.law.lyapunov(measurement, gains, craft) + epsilon * lean  # pyright: ignore
            potential = 2.0 * s * (1.0 - measurement.attitude[0])
            return rigid_body.kinetic_energy(measurement.rate, craft) + potential + epsilon * lean

        more: dict[str, Any] = {"gains": loop.gains} if s is None else {}
        digest_of = self.add(energy, measurement=ASKED, craft=self.plant, **more)
        self.written_by[digest_of] = WRITTEN | ({} if s is None else {"stiffness": s}) | {"epsilon": epsilon}
        return digest_of

    def softened(self, s: float | None, shape: Shape) -> str:
        """Record V = w.Mw/2 + epsilon q.Mw and a share of 2 s (1 - q0), or without s of the law's own V at rest."""
        loop, (epsilon, soft, moment) = self.loop, shape

        def energy(measurement: Measurement, craft: Any, gains: Any = None) -> Any:
            w, turn = measurement.rate, measurement.attitude
            moved = apply(craft.inertia, w) if moment is None else scale(moment, w)
            potential: Any = (
                loop.law.lyapunov(measurement._replace(rate=V3), gains, craft)  # pyright: ignore
                if s is None
                else 2.0 * s * (1.0 - turn[0])
            )
            return 0.5 * dot(w, moved) + epsilon * dot(vector_part(turn), moved) + soft * potential

        more: dict[str, Any] = {"gains": loop.gains} if s is None else {}
        digest_of = self.add(energy, measurement=ASKED, craft=self.plant, **more)
        self.written_by[digest_of] = WRITTEN | {"stiffness": s, "epsilon": epsilon, "soft": soft, "moment": moment}
        return digest_of

    def leaning(self, share: float) -> str:
        """Record the law's own V and epsilon q.Jw, at most this share of it."""
        form = self.form(self.lyapunov())
        scaled: Any = np.linalg.solve(np.linalg.cholesky(curvature(form, "w")), tensor(self.loop.craft.inertia))
        most = float(np.linalg.norm(scaled, 2))
        return self.crossed(None, float(f"{share * sqrt(-float(form.terms.get(('q0',), 0)) / 2.0) / most:.3g}"))

    @cached_property
    def subject(self) -> dict[str, str]:
        """The exact numbers that programs and the body may read."""
        loop, J = self.loop, tensor(self.loop.craft.inertia).tolist()
        named = [*labelled("gains", loop.gains), *labelled("craft", loop.known), ("measurement.period", float(loop.period))]
        numbers = {name: x.hex() for name, x in named if isfinite(x)}
        numbers |= {f"body.inertia.{i}.{k}": float(J[i][k]).hex() for i in range(3) for k in range(i, 3)}
        for k, (axis, p) in enumerate(zip(loop.wheel_axes, loop.rotors, strict=True)):
            numbers |= {f"wheel.{k}.axis.{i}": float(x).hex() for i, x in enumerate(axis)}
            numbers[f"wheel.{k}.momentum"] = float(p).hex()
        if (plan := self.plan) is not None:
            numbers |= {"plan.moves": str(plan.moves)}
            numbers |= {f"plan.state.{k}": float(x).hex() for k, x in enumerate(plan.state)}
            numbers |= {f"plan.command.{k}": float(x).hex() for k, x in enumerate(plan.command)}
            numbers |= {f"plan.end.{i}.{k}": float(plan.end[i, k]).hex() for i in range(6) for k in range(i, 6)}
            if isfinite(plan.limit):
                numbers["plan.limit.norm" if plan.ball else "plan.limit"] = float(plan.limit).hex()
        return numbers

    @property
    def words(self) -> list[str]:
        """Name the assumptions about the loop that apply."""
        loop, known = self.loop, self.known
        words = [OUTSIDE] if any(known.modelled) else []
        words += [MOVING] if known.moving else []
        words += [WHEELS] if loop.wheels is not None else []
        return words + ([PLANNED] if self.plan is not None else [REMEMBERS] if loop.remembers else [])

    def claim(self, theorem: str, taken: list[str], V: str | None, **numbers: Any) -> dict[str, Any]:
        """Return a claim without evidence."""
        roles = self.roles | ({} if V is None else {"lyapunov": V})
        return unproved(theorem, roles, self.subject, numbers, taken)

    @property
    def by_digest(self) -> dict[str, Any]:
        """The programs by their digests."""
        return by_digests(self.programs)

    def scales(self, V: str | None, level: float | None = None) -> dict[str, float]:
        """Return the approximate size of variables on {V <= level}."""
        known, J, top = self.known, tensor(self.loop.craft.inertia), self.potential(V)
        energy = min(level or top, top)
        scales = {f"q{k}": sqrt(energy / top) for k in (1, 2, 3)}
        scales |= {f"w{k}": sqrt(2.0 * energy / self.kinetic(V)[k - 1]) for k in (1, 2, 3)}
        scales |= {f"r{k}": float(known.target_rate) or 1.0 for k in (1, 2, 3)}
        scales |= {f"a{k}": float(known.target_acceleration) or 1.0 for k in (1, 2, 3)}
        return scales | {f"h{k}": float(known.total_momentum) or float(J.max()) * scales["w1"] for k in (1, 2, 3)}

    def form(self, V: str | None) -> Poly:
        """Return V as a polynomial."""
        if V is None:
            return Poly({})
        if V not in self.forms:
            self.forms[V] = AttitudeLoop(read(self.claim("converges", [], V), self.by_digest)).lyapunov
        return self.forms[V]

    def resting(self, V: str | None) -> list[float]:
        """Return V at rest at `TURNS`."""
        p = self.form(V).at({"w1": 0, "w2": 0, "w3": 0})
        return [float(p.at(dict(zip(("q0", "q1", "q2", "q3"), q, strict=True))).number) for q in TURNS]

    def potential(self, V: str | None) -> float:
        """Return the largest of V at rest."""
        return max(*map(abs, self.resting(V)), 1e-300) if V is not None else 1.0

    def kinetic(self, V: str | None) -> list[float]:
        """Return twice the sizes of the coefficients of the squares of the rates in V."""
        p = self.form(V)
        return [2.0 * abs(float(p.terms.get((f"w{k}", f"w{k}"), 0.5))) for k in (1, 2, 3)]

    def bounds(self, words: list[str]) -> dict[str, Any]:
        """Return the numbers that bound the loop's assumptions."""
        known, bounds = self.known, dict[str, Any]()
        if OUTSIDE in words:
            bounds |= {f"outside.{k}": above(x) for k, x in enumerate(known.modelled)}
        if MOVING in words:
            bounds |= {"target.rate": above(known.target_rate), "target.acceleration": above(known.target_acceleration)}
        bounds |= {"memory": memory_torque(self)} if REMEMBERS in words else {}
        return bounds | ({"momentum": float(known.total_momentum)} if WHEELS in words else {})

    @property
    def limits(self) -> dict[str, Any]:
        """Return the limits of the torque, or those of the wheels; empty where there are none."""
        loop, wheels = self.loop, self.loop.wheels
        shared = dict[str, Any]()
        if wheels is not None and wheels.allocation == 0:
            shared = {f"motors.{k}": x for k, x in enumerate(at_top_speed(wheels).torque_limit) if isfinite(x)}
            shared |= {f"stored.{k}": x * (1.0 - BAND) for k, x in enumerate(wheels.momentum_limit) if isfinite(x)}
        # Where wheels have limits, that of the command counts beside them, and not what they surely give together.
        most = loop.saturation_limit() if shared else loop.craft.torque_limit
        limit = most if loop.limit != "none" else inf
        return shared | ({"limit" if loop.limit == "axis" else "limit.norm": limit} if isfinite(limit) else {})

    def is_told(self, name: str) -> bool:
        """Return whether the law's program reads a component of a vector."""
        law = self.roles["law"]
        return any(one.startswith(f"{name}.") for one in Program.read(self.by_digest[law]).inputs)

    def try_to_show(self, claim: dict[str, Any], scales: Mapping[str, float], theorem: Theorem | None = None) -> bool:
        """Add a claim if evidence for it is found. theorem: what yields its obligations sooner."""
        try:
            self.claims.append(complete(claim, self.by_digest, scales, theorem))
        except NotFoundError as reason:
            self.failed[claim["theorem"]] = str(reason)
            return False
        self.failed.pop(claim["theorem"], None)
        return True

    def too_little_momentum(self) -> bool:
        """Return whether a body at rest on a rotating target has more momentum than claimed."""
        loop, known = self.loop, self.known
        least = float(np.linalg.eigvalsh(tensor(loop.craft.inertia))[0]) * (1.0 - 1e-12)
        return float(known.total_momentum) + float(np.linalg.norm(loop.stored)) < least * float(known.target_rate)


def memory_torque(loop: RecordedLoop) -> Fraction:
    """Return the largest torque (N m) that a law's memory adds about an axis: half the difference of the values to which it
    clips. RefusedError where no two of these differ by a number."""
    wired = AttitudeLoop(read(loop.claim("points", [], None), loop.by_digest))
    program = wired.claim.programs["law"]
    memory = {name: var(f"m{k}") for k, name in enumerate(program.inputs) if name.startswith("memory.")}
    most = Fraction(0)
    for cases in wired.read("law", len(program.outputs), memory)[:3]:
        ends = [case.value for case in cases if not any(name[0] == "m" for name in case.value.names)]
        most = max([most, *(abs((p - ends[0]).number) / 2 for p in ends)])
    return most


def curvature(form: Poly, x: str) -> NDArray[np.float64]:
    """Return the second derivative of V by the rate (w) or the attitude (q) where both vanish."""
    slopes = [[form.slope(f"{x}{i}").slope(f"{x}{k}").at(NOWHERE).number for k in (1, 2, 3)] for i in (1, 2, 3)]
    return np.array(slopes, dtype=np.float64)


def sign_words(loop: ClosedLoop) -> list[str]:
    """Return how the quaternion's sign is chosen, in the kernel's words."""
    return {"shortest": [SHORTEST], "hysteresis": [HYSTERESIS]}.get(loop.sign_policy, [])
