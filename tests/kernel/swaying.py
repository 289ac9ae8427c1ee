"""Flights of loops with appendages, in floats, steered against every bound of a certificate's evidence."""

import json
from fractions import Fraction
from functools import cache

import numpy as np

import starhold as sh
from starhold.certification.certify import Wanted, certify
from starhold.certification.evidence import appendages
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.finding import certificate
from starhold.certification.subject import make_subject
from starhold.kernel.numbers import rational
from starhold.scenario.building import build
from starhold.scenario.reading import make_scenario
from tests.kernel.flights import along, turned_on
from tests.kernel.programs import run, written

MOMENTS, MODES = [20.0, 30.0, 25.0], [[1.2, 0.01, 1.5, 0.2, 0.0, 0.0], [2.6, 0.01, 0.0, 1.0, 1.4, 0.0]]
BENDING = {
    "spacecraft": {"inertia": MOMENTS, "torque_limit": "0.5 N m"},
    "initial": {"angles": [0, 0, "1 deg"]},
    "target": {"mode": "inertial", "attitude": [1, 0, 0, 0]},
    "simulation": {"duration": "2 min", "control_period": 0.1},
    "part": [{"type": "flexible-modes", "modes": MODES}],
    "law": [{"type": "lyapunov", "k_rate": 8.0, "k_attitude": 3.0}],
}
TELLING = [
    {"type": "gyro", "bias": [2e-5, -1e-5, 1e-5]},
    {"type": "star-tracker", "cross": 0, "roll": 0, "mounting_error": [1e-4, 0, 0]},
    {"type": "constant-torque", "torque": [1e-4, 2e-4, -1e-4]},
]
BIASED = BENDING | {"part": [*BENDING["part"], *TELLING]}
SUBSTEPS = 1


@cache
def loop_of(name):
    if name == "panels":
        scenario = sh.load("flexible-slew")
        return build(scenario, scenario.laws[0])
    scenario = make_scenario({"name": "bending", **{"bent": BENDING, "biased": BIASED}[name]})
    return build(scenario, scenario.laws[0])


def found(loop):
    """The certificate of the claim that is found."""
    recorded = Loop(make_subject(loop))
    assert appendages.find_appended(recorded), recorded.failed
    return json.loads(json.dumps(certificate(recorded.programs, recorded.claims)))


@cache
def issued_of(name):
    return certify(loop_of(name), "", Wanted(pointing=True))


@cache
def content_of(name):
    """The certificate of the claim alone, which all tests of a run find once."""
    claim = issued_of(name).claim("appendages")
    assert claim is not None
    proof = claim.proof
    assert proof is not None
    return json.loads(json.dumps(certificate([*proof.programs.values()], [proof.claim])))


def columns(programs, claim, role):
    return written(programs[claim["programs"][role]])


class Swaying:
    """The loop of a claim, and its bounds; states are columns (w, q, v) beside q0."""

    def __init__(self, content, seed=1, lanes=64):
        (claim,) = content["claims"]
        self.claim, self.rng, self.lanes = claim, np.random.default_rng(seed), lanes
        self.motion, self.law, self.turning = (
            columns(content["programs"], claim, role) for role in ("motion", "law", "turning")
        )
        self.numbers = {name: float(Fraction(x)) for name, x in claim["numbers"].items()}
        self.subject = {name: float(rational(x)) for name, x in claim["subject"].items()}
        self.count = len(self.motion["outputs"]) - 3
        self.h, self.n = self.numbers["period"], 6 + self.count
        self.W = np.array([[float(Fraction(x)) for x in row] for row in claim["evidence"]["modes"]])
        self.blocks = claim["evidence"]["blocks"]
        self.V = programs_of(content, claim)

    def rates(self, x, torque):
        """The derivatives of (q0, q, w, v)."""
        q0, w, v = x[0], x[4:7], x[7:]
        given = {f"rate.{k}": w[k] for k in range(3)} | {f"torque.{k}": torque[k] for k in range(3)}
        given |= {f"state.{k}": v[k] for k in range(self.count)}
        moved = np.array([np.broadcast_to(y, q0.shape) for y in run(self.motion, given)])
        given = {f"rate.{k}": w[k] for k in range(3)} | {f"q.{k}": x[k] for k in range(4)}
        turned = np.array([np.broadcast_to(y, q0.shape) for y in run(self.turning, given)])
        return np.vstack([turned, moved])

    def command(self, q, w):
        """The law's torque at what it is told."""
        none = np.zeros(3)
        fields = {"attitude": q, "rate": w, "body_rate": w, "target_rate": none, "target_acceleration": none}
        fields |= {"external_torque": none, "wheel_momentum": none}
        given = {f"measurement.{name}.{k}": part for name, parts in fields.items() for k, part in enumerate(parts)}
        given |= {"measurement.is_valid": 1.0} | self.subject
        return np.array([np.broadcast_to(y, w[0].shape) for y in run(self.law, {k: given[k] for k in self.law["inputs"]})])

    def energy(self, x):
        """V of states."""
        given = {f"measurement.attitude.{k}": x[k] for k in range(4)} | {f"measurement.rate.{k}": x[4 + k] for k in range(3)}
        return self.V(given, self.subject)

    def starts(self):
        """States on the border of the start set, each as far as it goes along some mode or in some direction."""
        count, free, level = self.lanes, self.rng, self.numbers["level"]
        begun = np.array([self.numbers[f"begun.{k}"] for k in range(self.count)])
        toward = np.where(
            free.uniform(size=(count, 1)) < 0.7, self.W[free.integers(self.n, size=count)], free.normal(size=(count, self.n))
        )
        v = np.where(toward[:, 6:] == 0.0, free.choice([-1.0, 1.0], (count, self.count)), np.sign(toward[:, 6:])) * begun
        # About the farthest (w, q) of an ellipsoid in a direction, brought to the border.
        scale = self.reach()
        along = toward[:, :6] * scale**2
        along = np.where(np.abs(along).max(1, keepdims=True) > 0.0, along, free.normal(size=(count, 6)) * scale)
        low, high = np.zeros(count), np.full(count, 1.0) / np.abs(along[:, 3:]).max(1).clip(1e-300) * 0.3
        high = np.minimum(high, 1e3 * scale[:3].max() / np.abs(along[:, :3]).max(1).clip(1e-300))
        for _ in range(60):
            middle = (low + high) / 2.0
            inside = self.energy(self.state(middle[:, None] * along, v)) <= level
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return self.state(low[:, None] * along, v)

    def state(self, x, v):
        q = x[:, 3:].T
        return np.vstack([np.sqrt(1.0 - (q * q).sum(0)), q, x[:, :3].T, v.T])

    def reach(self):
        """About how far V lets each of (w, q) be on its own."""
        sizes = []
        for k in range(6):
            x = np.zeros((1, 6))
            x[0, k] = 1e-4
            sizes.append(1e-4 * np.sqrt(self.numbers["level"] / self.energy(self.state(x, np.zeros((1, self.count))))[0]))
        return np.array(sizes)

    def modes(self, x):
        """The sizes of modal coordinates."""
        y, at, sizes = self.W @ np.vstack([x[4:7], x[1:4], x[7:]]), 0, []
        for size in self.blocks:
            sizes.append(np.linalg.norm(y[at : at + size], axis=0))
            at += size
        return np.array(sizes)

    def pushed(self, x, name, toward):
        """A torque of the largest size that adds to what is largest."""
        most = self.numbers[name] + self.numbers.get(f"{name}.per.rate", 0.0) * np.linalg.norm(x[4:7], axis=0)
        z = np.vstack([x[4:7], x[1:4], x[7:]])
        way = self.gain.T @ (self.W.T @ (toward[:, None] * (self.W @ z)))
        way = np.where(np.abs(way).max(0) > 0.0, way, self.rng.normal(size=way.shape))
        return most * way / np.linalg.norm(way, axis=0)

    def against(self, seconds=None):
        """Fly, and return the largest share that is reached of each bound: of modes, states, torques, V, ends."""
        x, e = self.starts(), 1e-7
        rest = np.vstack([np.ones((1, 1)), np.zeros((6 + self.count, 1))])
        slopes = [(self.rates(rest, e * u[:, None]) - self.rates(rest, -e * u[:, None]))[:, 0] / (2 * e) for u in np.eye(3)]
        gain = np.array(slopes).T
        self.gain = np.vstack([gain[4:7], gain[1:4], gain[7:]])
        found, n = {}, 0
        last = len(self.claim["evidence"]["rounds"]) - 1
        most = int((seconds or self.numbers["settling"] * 1.2) / self.h)
        weight = None

        def note(name, sizes):
            found[name] = max(found.get(name, 0.0), float(np.max(sizes)))

        for k, one in enumerate(self.claim["evidence"]["rounds"]):
            sizes, torques, radii = (
                np.array([float(Fraction(y)) for y in one[p]])[:, None] for p in ("sizes", "torques", "radii")
            )
            spread = np.repeat(1.0 / radii[:, 0] ** 2, self.blocks)
            periods = one["periods"] if k < last else max(50, most - n)
            for _ in range(periods):
                if n >= most and k < last:
                    return found | {"flown": n}
                if weight is None or n % 400 == 0:
                    # Now all modes alike, now one of them.
                    chosen = self.rng.integers(-1, self.n)
                    weight = spread if chosen < 0 else spread * (np.arange(self.n) == chosen)
                note("modes", self.modes(x) / radii)
                note("V", self.energy(x) / self.numbers["highest"])
                told_q, told_w = self.told(x)
                asked = self.command(told_q, told_w)
                for name, size in (("limit", np.abs(asked).max()), ("limit.norm", np.linalg.norm(asked, axis=0).max())):
                    if name in self.numbers:
                        note(name, size / self.numbers[name])
                held = asked + self.pushed(x, "error", weight)
                for _ in range(SUBSTEPS):
                    torque = held + self.pushed(x, "outside", weight)
                    note("torques", np.abs(torque) / torques)
                    x = self.later(x, torque, self.h / SUBSTEPS)
                    note("sizes", np.abs(np.vstack([x[4:7], x[1:4], x[7:]])) / sizes)
                    if n * self.h > self.numbers["settling"]:
                        note("angle", 2 * np.arcsin(np.linalg.norm(x[1:4], axis=0)) / self.numbers["end.angle"])
                        note("rate", np.linalg.norm(x[4:7], axis=0) / self.numbers["end.rate"])
                n += 1
        return found | {"flown": n}

    def holds(self, seconds=60.0):
        """Whether no flight is against what the claim says of V, torques and the end, nor the set without what it holds."""
        reached = self.against(min(seconds, 1.2 * self.numbers["settling"] + 20.0 * self.h))
        said = max(reached.get(name, 0.0) for name in ("V", "limit", "limit.norm", "angle", "rate"))
        ends = np.hstack([np.eye(3), self.rng.normal(size=(3, 8))])
        said = max(said, *(np.max(self.steered(ends, part=part)) for part in (slice(3, 6), slice(3))))
        return said <= 1.0 + 1e-6 and self.contains()

    def contains(self):
        """Whether the set holds the turns at rest and the rates on target that are told."""
        axis, n = self.rng.normal(size=(3, 200)), self.numbers
        axis, none = axis / np.linalg.norm(axis, axis=0), np.zeros((200, self.count))
        turned, moving = axis * np.sin(n.get("angle", 0.0) / 2), axis * n.get("rate", 0.0)
        pairs = [(turned, 0.0 * axis), (0.0 * axis, moving)]
        pairs += [(axis * np.sin(n["start.angle"] / 2), axis[::-1] * n["start.rate"])] if "start.rate" in n else []
        return all((self.energy(self.state(np.vstack([w, q]).T, none)) <= n["level"] * (1 + 1e-9)).all() for q, w in pairs)

    def told(self, x):
        """What the law is told, with errors of the largest size in some directions."""
        q, w = x[:4], x[4:7]
        off, rate = (self.numbers.get(f"error.{name}", 0.0) for name in ("attitude", "rate"))
        if not off and not rate:
            return q, w
        a, b = (self.rng.normal(size=w.shape) for _ in range(2))
        return turned_on(q, off * along(a)), w + rate * along(b)

    def later(self, x, torque, s):
        """States after so many seconds."""
        a = self.rates(x, torque)
        b = self.rates(x + s / 2 * a, torque)
        c = self.rates(x + s / 2 * b, torque)
        x = x + s / 6 * (a + 2 * b + 2 * c + self.rates(x + s * c, torque))
        x[:4] /= np.linalg.norm(x[:4], axis=0)
        return x

    def after(self, x, outside, error, turned, rate):
        """States after a period in which torques from outside are those of `outside`, one after the other."""
        u = self.command(turned_on(x[:4], turned), x[4:7] + rate) + error
        for push in outside:
            x = self.later(x, u + push, self.h / len(outside))
        return x

    def responses(self, parts):
        """What a period does near rest, by differences of flown ones: to (w, q, v), and what pushes from outside in each of
        its parts, errors of the command, and errors of the attitude and of the rate that the law is told make of it."""
        e, n, none = 1e-6, self.n, np.zeros((3, self.n))

        def slope(z, vectors):
            sides = []
            for s in (-e, e):
                given = [s * v for v in vectors]
                x = self.after(self.state(s * z[:, :6], s * z[:, 6:]), given[:parts], *given[parts:])
                sides.append(np.vstack([x[4:7], x[1:4], x[7:]]))
            return (sides[1] - sides[0]) / (2 * e)

        count, made = parts + 3, []
        for k in range(count):
            vectors = [np.eye(3, n) if i == k else none for i in range(count)]
            made.append(slope(np.zeros((n, n)), vectors)[:, :3])
        return slope(np.eye(n), [none] * count), made

    def steered(self, ends, parts=1, left=1e-3, part=slice(3, 6)):
        """Fly from rest a lane for each direction of the angle or the rate at the last sample, (3, lanes): what is bounded
        turns over as the response does. The shares of the claimed angle and rate that each comes to."""
        A, made = self.responses(parts)
        ways = [np.zeros((self.n, ends.shape[1]))]
        ways[0][part] = along(ends)
        while (np.abs(ways[-1][:6]).max() > left or len(ways) < 50) and len(ways) < 20000:
            ways.append(A.T @ ways[-1])
        x = self.resting(ends.shape[1])
        sizes = [*["outside"] * parts, "error", "error.attitude", "error.rate"]
        for way in reversed(ways):
            fast = np.linalg.norm(x[4:7], axis=0)
            most = [self.numbers.get(one, 0.0) + self.numbers.get(f"{one}.per.rate", 0.0) * fast for one in sizes]
            chosen = [size * along(B.T @ way) for size, B in zip(most, made, strict=True)]
            x = self.after(x, chosen[:parts], *chosen[parts:])
        turned = 2 * np.arcsin(np.linalg.norm(x[1:4], axis=0))
        return turned / self.numbers["end.angle"], np.linalg.norm(x[4:7], axis=0) / self.numbers["end.rate"]

    def resting(self, lanes):
        """States on target."""
        return self.state(np.zeros((lanes, 6)), np.zeros((lanes, self.count)))

    def worst(self, rounds=3):
        """The largest angle of steered flights, in directions at random and then about the worst of them, as a share."""
        ends, found = along(self.rng.normal(size=(3, self.lanes))), 0.0
        for k in range(rounds):
            shares, _ = self.steered(ends)
            found, best = max(found, shares.max()), ends[:, np.argsort(-shares)[: max(self.lanes // 8, 1)]]
            spread = 0.3 / 4.0**k * self.rng.normal(size=ends.shape)
            ends = along(best[:, self.rng.integers(best.shape[1], size=self.lanes)] + spread)
        return found


def programs_of(content, claim):
    """V as a function of inputs, less what it is at rest on target."""
    program = columns(content["programs"], claim, "lyapunov")

    def value(given, subject):
        J = [[subject[f"body.inertia.{min(i, k)}.{max(i, k)}"] for k in range(3)] for i in range(3)]
        plant = {f"craft.inertia.{i}.{k}": J[i][k] for i in range(3) for k in range(3)}
        every = subject | plant | given
        rest = (
            every
            | {f"measurement.attitude.{k}": float(k == 0) for k in range(4)}
            | {f"measurement.rate.{k}": 0.0 for k in range(3)}
        )
        now, least = (run(program, {name: table[name] for name in program["inputs"]})[0] for table in (every, rest))
        return now - least

    return value
