"""Random loops of which a pointing bound is proved, and flights that are steered against it: `python -m
tests.certification.pointing_hunt SEED COUNT [TOLERANCE | KIND]` prints what came of each; KIND: "plans" for loops with
the predictive law, "targets" for ones that move, "shaken" for random torques, "late" for actuators that lag."""

import json
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from starhold.algebra.structure import flatten
from starhold.certification.certify import certify
from starhold.errors import InputError
from starhold.parts.craft import tensor
from starhold.scenario.building import build
from starhold.scenario.reading import parse
from starhold.simulation.lanes import simulate_many
from starhold.studies.bodies.rigid_body import wanted_of
from tests.certification.hunt import EARTH, random_inertia, unit
from tests.kernel.flights import Fleet, Surroundings, along, cross, times, turn
from tests.kernel.oracle import Oracle
from tests.kernel.planned import Planned as Plans
from tests.kernel.programs import run

LANES, PERIODS, SETTLED = 96, 2000, 40.0
"""Lanes of a fleet, the most periods that they fly, and the time in units of the loop's own after which nothing is left of
how flights on target begin."""


def random_loop(random, kind=""):
    """The text of a scenario of which a pointing bound may be proved: inertia, orbit, target, wheels, law, gains, period,
    start, and the parts that disturb, measure and estimate, all at random; of a kind what it has for certain."""

    def some(*choices):
        return choices[int(random.integers(len(choices)))]

    def size(low, high):
        return float(f"{10.0 ** random.uniform(math.log10(low), math.log10(high)):.6g}")

    def numbers(array):
        return json.dumps([float(f"{x:.9g}") for x in np.ravel(array)])

    J = random_inertia(random, size(1e-3, 1e3))
    scale, w = float(np.linalg.eigvalsh(J)[-1]), size(3e-3, 0.5)
    k, d = w * w * scale, 2.0 * w * scale * random.uniform(0.4, 1.5)
    period = float(f"{random.uniform(0.005, 0.25) / w:.4g}")
    inertia = json.dumps(J.tolist() if np.count_nonzero(J) > 3 else np.diagonal(J).tolist())
    lines = ['name = "hunted"', "[spacecraft]", f"inertia = {inertia}"]
    if random.uniform() < 0.4:
        lines += [f"torque_limit = {size(0.1, 10.0) * k:.6g}", f'limit = "{some("axis", "norm")}"']
    orbit, wheels = random.uniform() < 0.6, random.uniform() < 0.5
    if orbit:
        place, along_it, _ = np.linalg.qr(random.normal(size=(3, 3)))[0]
        r = 6.378e6 + size(3e5, 3.6e7)
        v = math.sqrt(EARTH / r) * some(1.0, 1.0, random.uniform(1.0, 1.05))
        lines += ["[orbit]", f"position = {numbers(r * place)}", f"velocity = {numbers(v * along_it)}"]
        lines += ['epoch = "2027-03-20T12:00:00Z"', "[environment]", f"gravity_gradient = {some('true', 'false')}"]
    attitude, rate = unit(random), some(0.0, 0.1 * w) * random.normal(size=3)
    lines += ["[initial]", f"attitude = {numbers(attitude)}", f"rate = {numbers(rate)}"]
    if kind == "targets":
        lines += target_of(random, some, size, numbers, orbit, w)
    else:
        lines += ["[target]", f'mode = "{some("inertial", "orbital") if orbit else "inertial"}"']
    if wheels:
        rotor = 10.0 ** random.uniform(-4, -2) * float(np.linalg.eigvalsh(J)[0])
        lines += ["[wheels]", f'layout = "{some("orthogonal", "pyramid")}"', f'inertia = "{rotor:.6g} kg m^2"']
        lines += [
            f"momentum = {some(0.0, size(1e-3, 0.1) * w * scale):.6g}",
            f'torque_limit = "{size(0.3, 10.0) * k:.6g} N m"',
        ]
        lines += [f'momentum_limit = "{size(0.5, 10.0) * w * scale:.6g} N m s"']
        lines += [f"viscous = {size(1e-6, 1e-3) * w * rotor:.6g}", f"coulomb = {size(1e-6, 1e-3) * k:.6g}"] * some(0, 1)
    law = some("lyapunov", "wheel", "wheel") if wheels else some("lyapunov", "lyapunov", "pd", "matrix-pd", "lqr", "wheel")
    law = "mpc" if kind == "plans" else law
    lines += [*parts_of(random, some, size, numbers, orbit, wheels, k, w, period)]
    if kind == "late":
        lines[2:2] = (
            [f"actuator_lag = {size(0.05, 3.0) * period:.6g}"]
            if some(0, 1)
            else [f"torque_rate_limit = {size(0.3, 30.0) * k * w:.6g}"]
        )
    if kind == "shaken":
        lines += ["[[part]]", 'type = "random-torque"', f"deviation = {size(1e-5, 1e-3) * k:.6g}"]
    lines += ["[simulation]", f"duration = {100.0 * period!r}", f"control_period = {period!r}"]
    lines += ["substeps = 64"] * (kind == "late")
    lines += ["[certify]", f"disturbance = {size(1e-6, 3e-2) * k:.6g}", "[[law]]", f'type = "{law}"']
    lines += [f'quaternion_sign = "{some("as_published", "shortest", "hysteresis")}"']
    if kind == "plans":
        # Gains of about this stiffness and damping.
        weights = [f"q_rate = {(d / k * random.uniform(0.2, 1.2)) ** 2:.6g}", f"r = {1.0 / k**2:.6g}", "q_attitude = 1.0"]
        horizon, terminal = int(random.integers(1, 13)), some("riccati", "riccati", "riccati", "stage")
        weights += [f"horizon = {horizon}", f'terminal = "{terminal}"', f'limit = "{some("axis", "norm")}"']
        return "\n".join([*lines, *weights]) + "\n"
    if law in ("lyapunov", "pd"):
        return "\n".join([*lines, f"k_rate = {d:.6g}", f"k_attitude = {k:.6g}"]) + "\n"
    spread = random.uniform(0.7, 1.4, size=3) if some(0, 1) else np.ones(3)
    # In proportion to the inertia, or not.
    shape = J / scale if some(0, 1) and law != "wheel" else np.eye(3)
    if law == "wheel":
        gains = [f"k_rate = {d:.6g}", f"k_attitude = {numbers(k * spread)}", f"compensation = {some(1.0, 1.0, 0.0)}"]
        return "\n".join([*lines, *gains]) + "\n"
    shape = shape * spread if np.allclose(shape, np.diag(np.diag(shape))) else shape
    gains = [f"k_rate = {json.dumps((d * shape).tolist())}", f"k_attitude = {json.dumps((k * shape).tolist())}"]
    return "\n".join([*lines, *gains, *([f"gyroscopic = {some(0.0, 1.0)}"] if law == "lqr" else [])]) + "\n"


def target_of(random, some, size, numbers, orbit, w):
    """Lines of a target that moves, by no more than the loop can follow."""
    kind = some("scan", "yaw-steering", "ground-station", "ground-strip", "slew") if orbit else "slew"
    given = ["[[part]]", f'type = "{kind}"']
    if kind == "scan":
        swing = size(0.02, 1.0) * w
        given += [
            f"amplitude = {size(0.05, 1.0):.6g}",
            f"swing = {2 * math.pi / swing:.6g}",
            f'shape = "{some("sinusoidal", "raster")}"',
        ]
    elif kind == "ground-station":
        given += [f"latitude = {random.uniform(-1.5, 1.5):.6g}", f"longitude = {random.uniform(-3.0, 3.0):.6g}"]
        given += [f"elevation = {random.uniform(0.1, 1.3):.6g}"]
    elif kind == "ground-strip":
        ends = random.uniform(-1.4, 1.4), random.uniform(-3.0, 3.0)
        given += [f"{key} = {x:.6g}" for key, x in zip(("latitude", "longitude"), ends, strict=True)]
        given += [f"to_{key} = {x + size(1e-3, 0.1):.6g}" for key, x in zip(("latitude", "longitude"), ends, strict=True)]
        given += ["begin = 0", f"duration = {size(10.0, 300.0):.6g}"]
    elif kind == "slew":
        given += [f"attitude = {numbers(unit(random))}", f"rate = {size(1e-3, 0.2) * w:.6g}"]
        given += [f"acceleration = {size(1e-4, 0.03) * w * w:.6g}"]
    return given


def parts_of(random, some, size, numbers, orbit, wheels, k, w, period):
    """Lines of parts that disturb and measure, each as large as it may be for its bound to be of use."""

    def vector(length):
        return numbers(length * along(random.normal(size=3)))

    def part(name, **keys):
        return ["[[part]]", f'type = "{name}"', *(f"{key} = {value}" for key, value in keys.items())]

    chance = random.uniform(size=8) < 0.35
    if chance[0]:
        yield from part("constant-torque", torque=vector(size(1e-6, 1e-2) * k), axes=some('"body"', '"inertial"'))
    if orbit:
        side = math.sqrt(size(1e-4, 1.0))
        plate = [0.1, *along(random.normal(size=3)), *(side * random.normal(size=3))]
        if chance[1]:
            yield from part("residual-dipole", dipole=vector(size(1e-2, 1e2) * k))
        if chance[2]:
            yield from part("drag", plates=f"[{numbers(plate)}]", density=size(1e-14, 1e-12))
        if chance[3]:
            yield from part("solar-pressure", plates=f"[{numbers([*plate, 0.3, 0.4])}]")
        if chance[4]:
            yield from part("oblateness")
    if chance[5]:
        # Readings without a filter.
        yield from part("gyro", bias=vector(size(1e-5, 1e-2) * w), noise=some(0.0, size(1e-6, 1e-4) * w * math.sqrt(period)))
        yield from part("star-tracker", cross=some(0.0, 1e-5), roll=some(0.0, 1e-5), mounting_error=vector(size(1e-5, 1e-2)))
    elif chance[6]:
        noise, walk, cross, roll = size(1e-5, 1e-3) * w, size(1e-5, 1e-3) * w, size(1e-5, 1e-3), size(1e-5, 1e-3)
        every = period * some(1, 1, 2, 4)
        same = {"noise": noise, "bias_walk": walk}
        yield from part("gyro", bias=vector(1e-3 * w), **same)
        yield from part("star-tracker", cross=cross, roll=roll, interval=every)
        yield from part("mekf", bias=1e-3 * w, **same)
    if orbit and wheels and chance[7]:
        yield from part("magnetometer", noise=size(1e-9, 1e-7), bias=vector(size(1e-9, 1e-7)))
        yield from part("magnetic-unloading", gain=size(1e-4, 1e-2) * w, dipole_limit=size(1e-2, 1.0) * k / 1e-5)


class Attack(Oracle):
    """Flights against a pointing claim: one half begins on the border of its set, one half on target."""

    longest = PERIODS

    def __init__(self, content, claim, seed, lanes=LANES):
        super().__init__(content, claim, seed)
        self.lanes = lanes
        _, stiffness = self.linear()
        self.slow = math.sqrt(np.linalg.eigvals(np.linalg.solve(self.J, stiffness)).real.min() / 2)

    def fleet(self):
        n = self.numbers

        def law(q, w, *around):
            given = self.inputs(q, w, *(around or [np.zeros(w.shape)] * 4))[0]
            return run(self.programs["law"], given)

        found = Fleet(
            self.true, law, n["period"], n["outside"], n["error"], self.slow, int(self.rng.integers(10**6)), self.lanes
        )
        if "late.torque.mean" in n:
            found.late = n["late.torque.kept"], n["late.torque.mean"], n["late.torque.begun"]
        found.growing = n.get("outside.per.rate", 0.0), n.get("error.per.rate", 0.0)
        found.around = Surroundings(
            [n.get(f"outside.{k}", 0.0) for k in range(3)], n.get("target.rate", 0.0), n.get("target.acceleration", 0.0),
            n.get("momentum") if "wheels" in self.words else None,
            *(n.get(f"error.{told}", 0.0) for told in ("attitude", "rate")),
            self.noise(self.lanes, self.rng) if "share" in n else None,
            (n.get("told.change", np.inf), n.get("told.change.per.rate", 0.0)),
            (n.get("noise.torque.deviation", 0.0), n.get("noise.torque", 0.0)),
        )  # fmt: skip
        return found

    def step(self):
        """What the state (w, q) and a torque held for a period are of the state after it, near rest."""
        h, inverse, zero = self.numbers["period"], np.linalg.inv(self.J), np.zeros((3, 3))
        B = np.vstack([h * inverse, h * h / 4 * inverse])
        return np.block([[np.eye(3), zero], [h / 2 * np.eye(3), np.eye(3)]]) - B @ np.hstack(self.linear()), B

    def extremal(self, periods):
        """Unit vectors that take the linear loop as far as it goes at an instant, in a direction of its own each lane: those
        of the adjoint, which begins anew after it."""
        (A, B), h = self.step(), self.numbers["period"]
        last = int(min(periods, max(50, 12 / (self.slow * h))))
        ends = self.rng.normal(size=(6, self.lanes))
        # Of the angle, but for some.
        ends[:3, self.rng.uniform(size=self.lanes) < 0.8] = 0.0
        ends[3:, : self.lanes // 8] = np.eye(3)[:, self.rng.integers(3, size=self.lanes // 8)]
        ways = [ends]
        for _ in range(last - 1):
            ways.append(A.T @ ways[-1])
        return [along(B.T @ way) for way in reversed(ways)]

    def highest_start(self):
        """V of the start set, beside which the torque that acts may be off by as much as is told."""
        n = self.numbers
        return n["level"] - n.get("late.torque.weight", 0.0) * n.get("late.torque.begun", 0.0) ** 2

    def worst(self):
        """What contradicts the claim, or "", and the largest angle and rate in the end as shares of the claimed ones."""
        n, h = self.numbers, self.numbers["period"]
        V0 = self.lyapunov(np.eye(4)[0], np.zeros(3))
        fleet, half = self.fleet(), self.lanes // 2
        states = [self.border(V0, self.highest_start() * self.rng.uniform() * (k % 3 > 0)) for k in range(half)]
        begin = (np.concatenate([np.array(part).T, np.tile(rest[:, None], half)], axis=1) for part, rest in zip(
            zip(*states, strict=True), (np.eye(4)[0], np.zeros(3)), strict=True))  # fmt: skip
        near = np.arange(self.lanes) >= half
        periods = int(min(n["settling"] / h + 300, self.longest))
        extremal, usual = self.extremal(periods), fleet.push

        def push(k, q, w):
            found = usual(k, q, w)
            found[:, ::2] = extremal[k % len(extremal)][:, ::2]
            return found

        # What begins on target has been there.
        fleet.unsettled = np.where(near, 0.0, 1.0)
        fleet.push, found, reached = push, "", [0.0, 0.0, 0.0]
        begun = SETTLED / self.slow if "share" in n else 0.0
        for k, q, w in fleet.fly(*begin, periods):
            settled = (k * h > n["settling"]) | (near & (k * h > begun))
            high = float((self.lyapunov(q, w) - V0).max()) / n["highest"]
            angle, rate = turn(q) / n["end.angle"], np.linalg.norm(w, axis=0) / n["end.rate"]
            shares = [high, *(float(x[settled].max()) if settled.any() else 0.0 for x in (angle, rate))]
            reached = [max(pair) for pair in zip(reached, shares, strict=True)]
            if max(shares) > 1.0 and not found:
                name = ("V", "angle", "rate")[int(np.argmax(shares))]
                found = f"{name} is {max(shares):.6g} of its bound after {k * h:g} s"
        return found, reached


def flown(loop, claim, random, lanes=128):
    """The largest angle of flights of the loop itself, with all its parts and their noise, as a share of the claimed one, at
    some instants after it has settled; from the border of the start set, towards a target at rest."""
    n, start = claim.numbers, np.array([*flatten((loop.start,)), *loop.rotors], dtype=float)
    states = np.tile(start[:, None], lanes)
    target, half = np.array(loop.target.params.attitude)[:, None], n["slew_angle"] * (1.0 - 1e-9) / 2.0
    turned = np.concatenate([np.full((1, lanes), math.cos(half)), math.sin(half) * along(random.normal(size=(3, lanes)))])
    states[:4], states[4:7] = times(target, turned), n["rate_start"] * along(random.normal(size=(3, lanes)))
    if loop.wheels is not None:
        stored = np.array(loop.rotors) @ np.array(loop.wheels.axes)
        total = np.linalg.norm(stored[:, None] + tensor(loop.craft.inertia) @ states[4:7], axis=0)
        states[4:7, total > n["momentum"]] = 0.0
    worst = 0.0
    for later in (1, 8, 41, 300):
        batch = simulate_many(loop, states, int(n["settling"] / n["period"]) + later)
        off = times(target * [[1.0], [-1.0], [-1.0], [-1.0]], batch.states[:4])
        worst = max(worst, float(turn(off).max()) / n["angle"])
    return worst


class Planned(Attack):
    """Flights of a law that plans, whose torque is that of the best plan, and how far this is from the program as a share of
    what is claimed, and from its limits. They are short, because the motion is sampled anew for each lane and period."""

    longest = 300

    def fleet(self):
        fleet, plan, self.shares = super().fleet(), Plans(self.subject, self.numbers, self.J), [0.0, 0.0]
        program, n = fleet.law, along(self.rng.normal(size=(3, self.lanes)))

        def law(q, w, *around):
            _, r, a, _ = around or [np.zeros(w.shape)] * 4
            ahead = cross(w + r, self.J @ (w + r)) - cross(w, self.J @ w) + self.J @ (a - cross(w, r))
            torques = plan.torques(q, w, n, ahead)
            off = np.linalg.norm(torques[0] - program(q, w, *around), axis=0).max() / self.numbers["plan.error"]
            self.shares = [max(pair) for pair in zip(self.shares, (off, plan.exceeded(torques)), strict=True)]
            return torques[0]

        fleet.law = law
        return fleet

    def worst(self):
        found, reached = super().worst()
        if max(self.shares) > 1.0 and not found:
            found = f"the plan is {self.shares} of its bounds"
        return found, reached


def proved_loop(seed, folder, tolerance=None, kind=""):
    """A random loop with its text and its claim; or why there is none, in place of the claim."""
    text = random_loop(np.random.default_rng(seed), kind)
    try:
        scenario = parse(text, "hunted.toml", folder)
        loop = build(scenario, scenario.laws[0])
    except InputError as reason:
        return None, text, f"refused: {reason}"
    certificate = certify(loop, "hunted", replace(wanted_of(scenario, True), alone=True, inertia_tolerance=tolerance))
    claim = certificate.claim("pointing")
    if claim is None or claim.outcome != "proved":
        why = [o.evidence.get("reason", "") for one in certificate.claims for o in one.obligations]
        return loop, text, "undecided: " + "; ".join(why or [certificate.unflown])
    return loop, text, claim


def hunted(seed, folder, tolerance=None, kind=""):
    """What became of a random loop: the text, why there is no claim or "", what contradicts it or "", and shares."""
    _, text, claim = proved_loop(seed, folder, tolerance, kind)
    if isinstance(claim, str):
        return text, claim, "", None
    attack, lanes = (Planned, LANES // 3) if kind == "plans" else (Attack, LANES)
    found, reached = attack({"programs": dict(claim.proof.programs)}, claim.proof.claim, seed, lanes).worst()
    return text, "", found, (claim, reached)


def main(first, count, tolerance=None, of=""):
    """Print a line for each loop, and how many of each kind there were."""
    begun, tally = time.time(), dict.fromkeys(("refused", "undecided", "proved", "broken"), 0)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            text, why, found, more = hunted(seed, Path(folder), tolerance, of)
            kind, shown = why.split(":")[0] or "proved", why
            if more:
                claim, (V, angle, rate) = more
                kept = f"share {claim.numbers['share']} off {claim.numbers.get('tolerance', 0.0)}"
                n = claim.numbers
                ends = f"{math.degrees(n['angle']):.3g} of {math.degrees(n['slew_angle']):.3g} deg"
                shown = f"V {V:.3f} angle {angle:.3f} rate {rate:.3f}, {ends}, {kept} {found and 'BROKEN ' + found}"
            tally[kind] += 1
            tally["broken"] += bool(found)
            law = text.rsplit('type = "', 1)[1].split('"')[0]
            print(seed, law, kind, shown, flush=True)
    print(tally, f"{time.time() - begun:.0f} s")


if __name__ == "__main__":
    asked = sys.argv[3:4]
    main(*map(int, sys.argv[1:3]), *([None, *asked] if asked[:1] and asked[0].isalpha() else map(float, asked)))
