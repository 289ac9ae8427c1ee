"""The worst flights that are known of a loop near its target. From what a period of the fleet's own motion does to small
deviations, pushes, errors and noise are chosen, lane by lane, that take the loop as far as they may in a direction at the
last sample: all that is bounded turns over as the response does, noise comes as it most likely comes when it is as rare as
the claim lets it be, momentum lies across the target's turn so that it leans the body, and target and momentum stay so."""

from typing import NamedTuple

import numpy as np

from tests.certification.attack import Attack
from tests.kernel import flights
from tests.kernel.flights import along, cross, turn

SMALL, LEFT, LONGEST = 1e-6, 1e-3, 20000
"""The deviations by which the motion is differentiated, what is left of how a flight began when it counts, and the most
samples until its end."""


class Leaning(flights.Around):
    """Targets that turn about given axes, as fast as they may at the last sample, with given momenta."""

    def __init__(self, bounds, J, inverse, axis, kept, end=0.0):
        super().__init__(bounds, J, inverse, np.random.default_rng(1), axis.shape[1])
        self.axis, self.kept, self.phase = axis, kept.copy(), np.full(axis.shape[1], -self.swing * end)


class Scheduled:
    """Noise that was chosen, in place of drawn one: errors of the attitude and the rate at one sample after the other."""

    def __init__(self, errors):
        self.errors, self.k = errors, -1

    def told(self):
        self.k += 1
        return self.errors[self.k][:3], self.errors[self.k][3:]


class Motion(NamedTuple):
    """What a period does, a lane each: to (w, q), (lanes, 6, 6), and what a push, and errors of the attitude and of the rate
    that the law is told, make of it, (lanes, 6, 3); with the torque that acts as a further vector where it is late."""

    A: np.ndarray
    push: np.ndarray
    attitude: np.ndarray
    rate: np.ndarray


class Worst(NamedTuple):
    """The largest angle and rate as shares of the claimed ones, the angle of each lane at its last sample, and how many
    samples each flew."""

    angle: float
    rate: float
    each: np.ndarray
    samples: int


class Steered(Attack):
    """Flights from on target, each lane in a direction of its own."""

    def __init__(self, content, claim, seed=1, lanes=512, longest=LONGEST):
        super().__init__(content, claim, seed, lanes)
        self.most = longest // 2
        self.fleet_of = self.fleet()
        # Flights begin on target, where they have been.
        self.fleet_of.unsettled = 0.0
        self.bounds = self.fleet_of.around._replace(noise=None)
        self.inverse = np.linalg.inv(self.true)

    def after(self, around, q, w, push=0.0, attitude=0.0, rate=0.0, torque=0.0):
        """(w, q) after the first period with a held push, and what the law is told off by such vectors; and the torque that
        acts, if it is late."""
        zero, h = np.zeros(w.shape), self.numbers["period"]
        bounds = around.bounds
        around.bounds, kept = bounds._replace(turned=1.0, rated=1.0, change=(np.inf, 0.0), moving=None), around.kept
        around.load, around.told = zero, 0.0 * around.told
        command = around.command(self.fleet_of.law, q, w, 0.0, zero, (attitude + zero, rate + zero))
        fleet, acting, late = self.fleet_of, [command] * 2, self.fleet_of.late
        if late:
            fleet.before, fleet.off = command, torque - command
            acting = fleet.acting(command, 2)
        for k in range(2):
            q, w = around.after(q, w, (k + 0.5) * h / 2, acting[k] + push, zero, h / 2)
        around.bounds, around.kept = bounds, kept
        return np.concatenate([w, q[1:], command + fleet.off] if late else [w, q[1:]])

    def motion(self, axis, kept):
        """The motion near the target, as it turns, with these momenta."""
        lanes = axis.shape[1]
        rest, zero = np.tile(np.eye(4)[:, :1], (1, lanes)), np.zeros((3, lanes))

        def slopes(change):
            given = self.bounds, self.true, self.inverse, axis, kept
            sides = [self.after(Leaning(*given), *change(s * SMALL)) for s in (-1, 1)]
            return (sides[1] - sides[0]).T / (2 * SMALL)

        def beside(k, **others):
            return lambda s: (rest, zero, *(s * np.eye(3)[:, k : k + 1] * others.get(n, 0.0) for n in "part"))

        def state(k):
            axis = np.eye(3)[:, k % 3 : k % 3 + 1] + zero
            if k >= 6:
                return beside(k - 6, t=1.0)
            if k < 3:
                return lambda s: (rest, s * axis)
            return lambda s: (np.concatenate([np.full((1, lanes), np.sqrt(1 - s * s)), s * axis]), zero)

        A = np.stack([slopes(state(k)) for k in range(9 if self.fleet_of.late else 6)], axis=2)
        return Motion(A, *(np.stack([slopes(beside(k, **{n: 1.0})) for k in range(3)], axis=2) for n in "par"))

    def samples(self, motion):
        """In how many samples nothing is left of how a flight began."""
        slowest = np.abs(np.linalg.eigvals(motion.A[:16])).max()
        return int(min(np.log(LEFT) / np.log(slowest), self.most))

    def turned(self, ends):
        """Axes of targets and momenta, (3, lanes), which lean a body towards its end as far as they can."""
        lean = along(np.linalg.solve(self.linear()[1].T, ends))
        axis = along(cross(lean, self.rng.normal(size=lean.shape)))
        return axis, -(self.numbers.get("momentum") or 0.0) * along(cross(lean, axis))

    def aims(self, motion, ends):
        """What counts of a state at the last sample."""
        return np.concatenate([0.0 * ends, ends, *[0.0 * ends] * (motion.A.shape[1] // 3 - 2)])

    def noisy(self, motion, ends, count):
        """Errors of attitude and rate, (samples, 6, lanes), which noise makes when the motion that it drives comes to the
        border of what the claim says is rare, in the directions `ends` at the last sample."""
        noise = self.noise(1, self.rng)
        size, every = len(noise.x), len(noise.steps)
        made = np.concatenate([motion.attitude, motion.rate], axis=2)
        way, felt, wanted = self.aims(motion, ends), np.zeros((size, ends.shape[1])), []
        for k in reversed(range(count)):
            step = noise.steps[(k + 1) % every]
            slope = step[size:].T @ np.einsum("nik,in->kn", made, way) + step[:size].T @ felt
            felt, way = slope[:size], np.einsum("nij,in->jn", motion.A, way)
            wanted.append(slope[size:])
        x, z, errors, most = np.zeros((size, ends.shape[1])), 0.0 * way, [], np.zeros(ends.shape[1])
        radii = self.radii()[:4]
        for k, n in enumerate(reversed(wanted)):
            y = noise.steps[(k + 1) % every] @ np.concatenate([x, n])
            x = y[:size]
            errors.append(y[size:])
            z = np.einsum("nij,jn->in", motion.A, z) + np.einsum("nij,jn->in", made, y[size:])
            sizes = np.array([np.linalg.norm(part, axis=0) for part in (y[size : size + 3], y[size + 3 :], z[:3], z[3:6])])
            most = np.maximum(most, (sizes / radii).max(axis=0))
        # Lanes in which noise drives nothing towards the end have none.
        return [one / np.where(most > 0.0, most, 1.0) for one in errors]

    def fly(self, ends, axis=None):
        """Fly one lane in each direction of the angle, (3, lanes)."""
        n, h, fleet = self.numbers, self.numbers["period"], self.fleet_of
        turning, kept = self.turned(ends)
        axis = turning if axis is None else axis
        motion = self.motion(axis, kept)
        last = self.samples(motion)
        count = 2 * last
        ways = [self.aims(motion, ends)]
        for _ in range(last - 1):
            ways.append(np.einsum("nij,in->jn", motion.A, ways[-1]))
        # Momentum turns in the target's axes, once around in a turn of it.
        angle = self.bounds.rate * count * h
        kept = kept * np.cos(angle) + cross(axis, kept) * np.sin(angle)

        def chosen(part, k):
            return along(np.einsum("nik,in->kn", part, ways[min(count - 1 - k, last - 1)]))

        fleet.push = lambda k, q, w: chosen(motion.push, k)
        fleet.misread = lambda k, q, w: (chosen(motion.attitude, k), chosen(motion.rate, k))
        fleet.surroundings = lambda bounds, J, inverse, rng, lanes: Leaning(bounds, J, inverse, axis, kept, count * h)
        noise = Scheduled(self.noisy(motion, ends, count)) if "share" in n else None
        fleet.around, fleet.lanes = self.bounds._replace(noise=noise), ends.shape[1]
        far = fast = 0.0
        for k, q, w in fleet.fly(np.tile(np.eye(4)[:, :1], (1, ends.shape[1])), 0.0 * ends, count):
            if k >= last:
                each = turn(q)
                far, fast = max(far, float(each.max())), max(fast, float(np.linalg.norm(w, axis=0).max()))
        return Worst(far / n["end.angle"], fast / n["end.rate"], each / n["end.angle"], count)

    def search(self, rounds=4):
        """Fly as many lanes in each round, first in all directions and then about the worst of them; the worst."""
        ends, found = along(self.rng.normal(size=(3, self.lanes))), []
        for k in range(rounds):
            found.append(self.fly(ends))
            best = ends[:, np.argsort(-found[-1].each)[: max(self.lanes // 16, 1)]]
            spread = 0.3 / 3.0**k * self.rng.normal(size=(3, self.lanes))
            ends = along(best[:, self.rng.integers(best.shape[1], size=self.lanes)] + spread)
        return max(found, key=lambda one: one.angle), [one.angle for one in found]
