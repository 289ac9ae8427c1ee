"""Flights that are steered against pointing claims, within the bounds that these tell: of a claim's own programs, and of the
loop itself."""

import math
from functools import cached_property

import numpy as np

from starhold.algebra.structure import flatten
from starhold.parts.craft import tensor
from starhold.simulation.lanes import simulate_many
from tests.kernel.flights import along, cross, times, turn
from tests.kernel.oracle import Oracle
from tests.kernel.planned import Planned as Plans
from tests.tiers import fewer

LANES, PERIODS, SETTLED = 96, fewer(2000, 4), 40.0
"""Lanes of a fleet, the most periods that they fly, and the time in units of the loop's own after which nothing is left of
how flights on target begin."""


class Attack(Oracle):
    """Flights against a pointing claim: one half begins on the border of its set, one half on target."""

    longest = PERIODS

    def __init__(self, content, claim, seed, lanes=LANES):
        super().__init__(content, claim, seed)
        self.lanes = lanes

    def step(self):
        """What the state (w, q) and a torque held for a period are of the state after it, near rest."""
        h, inverse, zero = self.numbers["period"], np.linalg.inv(self.J), np.zeros((3, 3))
        B = np.vstack([h * inverse, h * h / 4 * inverse])
        return np.block([[np.eye(3), zero], [h / 2 * np.eye(3), np.eye(3)]]) - B @ np.hstack(self.linear()), B

    def extremal(self, ends, count):
        """Unit vectors of a push, and of errors of the attitude and the rate, at `count` samples, that take the linear loop
        as far as it goes at the end of the last of them in the directions `ends` of (w, q), (6, lanes)."""
        (A, B), (damping, stiffness), ways = self.step(), self.linear(), [ends]
        for _ in range(count - 1):
            ways.append(A.T @ ways[-1])
        pushes = [B.T @ way for way in reversed(ways)]
        return [tuple(along(x) for x in (p, -stiffness.T @ p, -damping.T @ p)) for p in pushes]

    def spell(self, periods):
        """Extremal pushes and errors for each lane's own direction; they begin anew after the last."""
        last = int(min(periods, max(50, 12 / (self.slow * self.numbers["period"]))))
        ends = self.rng.normal(size=(6, self.lanes))
        # Of the angle, but for some.
        ends[:3, self.rng.uniform(size=self.lanes) < 0.8] = 0.0
        ends[3:, : self.lanes // 8] = np.eye(3)[:, self.rng.integers(3, size=self.lanes // 8)]
        return self.extremal(ends, last)

    def highest_start(self):
        """V of the start set, beside which the torque that acts may be off by as much as is told."""
        n = self.numbers
        return n["level"] - n.get("late.torque.weight", 0.0) * n.get("late.torque.begun", 0.0) ** 2

    @cached_property
    def rows(self):
        """What takes a torque to its shares of limits about the axes and of motors."""
        n = self.numbers
        rows = [np.eye(3) / n.get("limit", np.inf)]
        turned = [k for k in range(len(n)) if n.get(f"motors.{k}")]
        if turned:
            axes = np.array([[self.subject[f"wheel.{k}.axis.{i}"] for k in turned] for i in range(3)])
            rows.append(np.linalg.pinv(axes) / np.array([[n[f"motors.{k}"]] for k in turned]))
        return np.concatenate(rows)

    def loads(self, u):
        """The largest share of a limit, of the torque or of a motor, that torques (3, lanes) take."""
        used = np.linalg.norm(u, axis=0) / self.numbers.get("limit.norm", np.inf)
        return np.maximum(used, np.abs(self.rows @ u).max(axis=0))

    def asked(self, law, q, w, momentum):
        """The largest share of a limit that the law asks for because of states and of this momentum, or of any that there
        may be."""
        if "momentum" not in self.numbers:
            return self.loads(law(q, w))
        none = 0.0 * w
        if momentum is not None:
            return self.loads(law(q, w, none, none, none, momentum))
        ways = self.numbers["momentum"] * np.eye(3)[:, :, None]
        u, *others = (self.rows @ law(q, w, none, none, none, none + one) for one in (none, *ways))
        return (np.abs(u) + np.linalg.norm(np.array(others) - u, axis=0)).max(axis=0)

    def kept_bounds(self, law, q, w, momentum=None):
        """The shares of the claim's bounds of w.Jw, and of what the law asks for because of state and momentum, that states
        take, with any momentum if none is given."""
        n = self.numbers
        asked = self.asked(law, q, w, momentum) / n["asked"] if "asked" in n else np.zeros(w.shape[1])
        return (w * (self.J @ w)).sum(axis=0) / n.get("kinetic", np.inf), asked

    def into(self, law, q, w):
        """States of the set near those that are beyond its bounds of rate and torque."""
        q, w = q.copy(), w.copy()
        for k in range(400):
            beyond = np.max(self.kept_bounds(law, q, w), axis=0) > 1.0
            if not beyond.any():
                return q, w
            w[:, beyond] *= 0.97
            if k > 100:
                q[1:, beyond] *= 0.97
                q[0, beyond] = np.sqrt(1.0 - (q[1:, beyond] ** 2).sum(axis=0)) * np.where(q[0, beyond] < 0.0, -1.0, 1.0)
        raise AssertionError("no state of the set was found")

    def worst(self):
        """What contradicts the claim, or "", and the largest angle and rate in the end as shares of the claimed ones."""
        n, h = self.numbers, self.numbers["period"]
        V0 = self.lyapunov(np.eye(4)[0], np.zeros(3))
        fleet, half = self.fleet(), self.lanes // 2
        states = [self.border(V0, self.highest_start() * self.rng.uniform() * (k % 3 > 0)) for k in range(half)]
        begin = (np.concatenate([np.array(part).T, np.tile(rest[:, None], half)], axis=1) for part, rest in zip(
            zip(*states, strict=True), (np.eye(4)[0], np.zeros(3)), strict=True))  # fmt: skip
        begin, law, self.used = self.into(fleet.law, *begin), fleet.law, np.zeros(3)
        near = np.arange(self.lanes) >= half

        def asking(q, w, *around):
            u = law(q, w, *around)
            self.used[2] = max(self.used[2], self.loads(u).max())
            return u

        fleet.law = asking
        periods = int(min(n["settling"] / h + 300, self.longest))
        extremal, usual, way = self.spell(periods), fleet.push, self.rng.choice([-1.0, 1.0], self.lanes)

        def steered(kind, k, others):
            others[:, ::2] = extremal[k % len(extremal)][kind][:, ::2]
            return others

        def push(k, q, w):
            return steered(0, k, usual(k, q, w))

        def misread(k, q, w):
            unit = usual(k, q, w)
            return steered(1, k, way * unit), steered(2, k, -unit)

        # What begins on target has been there.
        fleet.unsettled = np.where(near, 0.0, 1.0)
        fleet.push, fleet.misread, found, reached = push, misread, "", [0.0, 0.0, 0.0]
        begun = SETTLED / self.slow if "share" in n else 0.0
        for count, (k, q, w) in enumerate(fleet.fly(*begin, periods)):
            settled = (k * h > n["settling"]) | (near & (k * h > begun))
            high = float((self.lyapunov(q, w) - V0).max()) / n["highest"]
            angle, rate = turn(q) / n["end.angle"], np.linalg.norm(w, axis=0) / n["end.rate"]
            shares = [high, *(float(x[settled].max()) if settled.any() else 0.0 for x in (angle, rate))]
            reached = [max(pair) for pair in zip(reached, shares, strict=True)]
            # Between samples nothing is asked for.
            if count % 2:
                momentum = fleet.surrounding.kept if "momentum" in n else None
                self.used[:2] = np.maximum(self.used[:2], np.max(self.kept_bounds(law, q, w, momentum), axis=1))
            shares += [*self.used]
            if max(shares) > 1.0 and not found:
                of = "V", "angle", "rate", "w.Jw", "what is asked because of state and momentum", "torque"
                name = of[int(np.argmax(shares))]
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
