"""Flights of a body with a held torque, many lanes at once, under pushes that are chosen against what is claimed: an own
motion in NumPy, which shares no code with the kernel or with what starhold flies."""

from typing import NamedTuple

import numpy as np

NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
WINDOWS = 12
"""How many windows of samples errors remember that grow with the motion."""


def cross(a, b):
    return a.take(NEXT, 0) * b.take(LAST, 0) - a.take(LAST, 0) * b.take(NEXT, 0)


def along(v):
    return v / np.maximum(np.linalg.norm(v, axis=0), 1e-300)


def times(p, q):
    """The product of quaternions."""
    return np.concatenate([[p[0] * q[0] - (p[1:] * q[1:]).sum(0)], p[0] * q[1:] + q[0] * p[1:] + cross(p[1:], q[1:])])


def seen(q, v):
    """A vector of the target's axes in the body's."""
    return v + 2 * cross(-q[1:], cross(-q[1:], v) + q[0] * v)


def rates(J, inverse, q, w, torque):
    own = q[1:]
    turned = np.concatenate([[-(own * w).sum(0)], q[0] * w + cross(own, w)]) / 2
    return turned, inverse @ (torque - cross(w, J @ w))


def stepped(slope, x, h):
    """The parts of a state after a time (Runge and Kutta)."""
    a = slope(*x)
    b = slope(*(y + h / 2 * k for y, k in zip(x, a, strict=True)))
    c = slope(*(y + h / 2 * k for y, k in zip(x, b, strict=True)))
    d = slope(*(y + h * k for y, k in zip(x, c, strict=True)))
    q, *others = (y + h / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]) for k, y in enumerate(x))
    return q / np.linalg.norm(q, axis=0), *others


def moved(J, inverse, q, w, torque, h):
    """The state after a time in which the torque does not change."""
    return stepped(lambda q, w: rates(J, inverse, q, w, torque), (q, w), h)


class Surroundings(NamedTuple):
    """Bounds of a torque that the law is told (about each axis), of a target's rate and acceleration, of the momentum with
    wheels (None: there are none), of errors of the attitude and the rate that it is told, and of how fast the torque changes
    that it is told, with what is more for each rad that the body turns; the deviation of a random torque and the most that
    it is; and how much more attitude and rate are off for each unit of the body's rate and acceleration in so many of the
    last samples, of which a share is left after as many more (rows, samples, period, share)."""

    told: list
    rate: float
    acceleration: float
    momentum: float | None
    turned: float
    rated: float
    noise: "Noise | None" = None
    change: tuple = (np.inf, 0.0)
    shaken: tuple = (0.0, 0.0)
    moving: tuple | None = None


class Noise:
    """Errors of the attitude and the rate that a law is told, which noise drives, at one sample after the other, once they
    have settled: by the matrices of a sample without a new measurement and with one."""

    def __init__(self, carried, corrected, every, lanes, rng, begun=2500):
        self.steps, self.rng, self.k = [corrected, *[carried] * (every - 1)], rng, 0
        self.x = np.zeros((len(carried) - 6, lanes))
        for _ in range(begun):
            self.told()

    def told(self):
        self.k += 1
        step, (size, lanes) = self.steps[self.k % len(self.steps)], self.x.shape
        y = step @ np.concatenate([self.x, self.rng.normal(size=(step.shape[1] - size, lanes))])
        self.x = y[:size]
        return y[size : size + 3], y[size + 3 :]


def turned_on(q, angles):
    """Attitudes turned on by vectors of angles in the body's axes."""
    size = np.linalg.norm(angles, axis=0)
    return times(q, np.concatenate([[np.cos(size / 2)], np.sinc(size / 2 / np.pi) / 2 * angles]))


class Around:
    """What acts on lanes from their surroundings: targets that swing about axes of their own as fast as they may, told
    torques that change sides, at once if they may, and errors along the pushes."""

    def __init__(self, bounds, J, inverse, rng, lanes):
        self.bounds, self.J, self.inverse = bounds, J, inverse
        self.axis, self.phase = along(rng.normal(size=(3, lanes))), rng.uniform(0, np.pi, lanes)
        self.axis[:, ::2] = np.eye(3)[:, rng.integers(3, size=len(self.phase[::2]))]
        self.swing = bounds.acceleration / max(bounds.rate, 1e-300)
        self.told = np.array(bounds.told)[:, None]
        self.kept = 0.7 * (bounds.momentum or 0.0) * along(rng.normal(size=(3, lanes)))
        self.load, self.sudden, self.past, self.windows = None, not np.isfinite(bounds.change[0]), [], []
        self.samples = 0

    def target(self, q, t):
        if not self.bounds.rate and not self.bounds.acceleration:
            return np.zeros((2, *self.axis.shape))
        angle = self.swing * t + self.phase
        rate, slope = self.bounds.rate * np.cos(angle), -self.bounds.acceleration * np.sin(angle)
        return seen(q, rate * self.axis), seen(q, slope * self.axis)

    def misled(self, q, w, t):
        """How far attitude and rate are off that the law is told: as much as they may be after the last samples, and after
        those before, of which they forget a share in as many samples."""
        turned, rated = self.bounds.turned, self.bounds.rated
        if self.bounds.moving is None:
            return turned, rated
        rows, count, h, kept = self.bounds.moving
        inertial = w + self.target(q, t)[0]
        before = self.past[-1][0] if self.past else inertial
        self.past = [*self.past, (inertial, np.linalg.norm(inertial - before, axis=0) / h)][-count - 1 :]
        fast = np.max([np.linalg.norm(one, axis=0) for one, _ in self.past], axis=0)
        last = most = np.stack([fast, np.max([one for _, one in self.past[-count:]], axis=0)])
        share, told = 1.0, 0.0
        for one in [most, *self.windows]:
            most = np.maximum(most, one)
            told, share = told + share * (1.0 - kept) * most, share * kept
        self.samples += 1
        if kept and self.samples % count == 0:
            self.windows = [last, *self.windows][:WINDOWS]
        more = np.array(rows) @ (told + share * most)
        return turned + more[0], rated + more[1]

    def command(self, law, q, w, t, unit, misread=None):
        """What the law asks for, with what it is told; misread: the ways in which attitude and rate are off."""
        off, fast = misread or (unit, -unit)
        turned, rated = self.misled(q, w, t)
        wrong, fast = turned_on(q, turned * off), rated * fast
        if self.bounds.noise:
            angles, rated = self.bounds.noise.told()
            wrong, fast = turned_on(wrong, angles), fast + rated
        (r, _), (off, a) = self.target(q, t), self.target(wrong, t)
        rate = w + r - off + fast
        stored = self.kept - self.J @ (w + r)
        total = stored + self.J @ (rate + off) if self.bounds.momentum is not None else self.kept
        if self.load is None or self.sudden:
            self.load = -self.told * np.sign(unit)
        # What is told of it is that at the attitude that is told.
        load = self.load if self.sudden else self.load - self.bounds.change[1] * self.bounds.turned * unit
        return law(wrong, rate, load, off, a, total)

    def loaded(self, unit, fast, time):
        """The told torque in the mean of a time in which it turns over, as fast as it may with the body's rates."""
        change, more = self.bounds.change
        over = self.told * np.sign(unit) - self.load
        part = 1.0 if self.sudden else (change + more * fast) * time / np.maximum(np.linalg.norm(over, axis=0), 1e-300)
        begun, self.load = self.load, self.load + np.minimum(part, 1.0) * over
        return self.load if self.sudden else (begun + self.load) / 2

    def after(self, q, w, t, torque, outside, h):
        """The state after a time in which torques do not change."""

        def slope(q, w, H):
            r, a = self.target(q, t)
            H = H if self.bounds.momentum is not None else self.J @ (w + r)
            turning, _ = rates(self.J, self.inverse, q, w, torque)
            pushed = torque + outside - cross(w + r, H) - self.J @ (a - cross(w, r))
            return turning, self.inverse @ pushed, outside - cross(w + r, H)

        q, w, self.kept = stepped(slope, (q, w, self.kept), h)
        return q, w


def pushes(rng, lanes, h, slow):
    """Unit vectors as functions of the period and the state, one kind a quarter of the lanes: with w + c q, which feeds
    energy in; about one axis, with its own w + c q; as the axis swings, forever; and one way that changes now and then."""
    kinds = np.arange(lanes) % 4
    c = slow * 10.0 ** rng.uniform(-2, 0.5, lanes)
    axis = along(rng.normal(size=(3, lanes)))
    axis[:, lanes // 2 :] = np.eye(3)[:, rng.integers(3, size=lanes - lanes // 2)]
    swing, phase, hold = slow * rng.uniform(0.3, 1.5, lanes), rng.uniform(0, 2 * np.pi, lanes), rng.integers(5, 400, lanes)

    def chosen(n, q, w):
        s = w + c * q[1:]
        sign = np.select(
            [kinds == 1, kinds == 2, kinds == 3],
            [
                np.where((axis * s).sum(0) >= 0, 1, -1),
                np.where(np.sin(swing * n * h + phase) >= 0, 1, -1),
                1 - 2 * ((n // hold) % 2),
            ],
            1,
        )
        return np.where(kinds == 0, along(s), sign * axis)

    return chosen


class Fleet:
    """Lanes of a body under a law that is a function of (q, w); how fast it answers is told, for pushes in time with it."""

    def __init__(self, J, law, h, outside, error, slow, seed=1, lanes=400):
        self.J, self.law, self.h, self.outside, self.error = np.asarray(J, dtype=float), law, h, outside, error
        self.inverse, self.rng, self.lanes = np.linalg.inv(self.J), np.random.default_rng(seed), lanes
        # `misread`: the ways of errors of attitude and rate, as push is; `added`: what a memory adds about each axis.
        self.misread, self.added = None, 0.0
        # `growing`: what torque and error are more (N m s) times the body's rate, where there are surroundings.
        self.push, self.around, self.growing = pushes(self.rng, lanes, h, slow), None, (0.0, 0.0)
        self.surroundings = Around
        self.late, self.off, self.unsettled = None, None, 1.0

    def acting(self, command, parts):
        """Torques that act in the parts of a period, in the mean, after what is asked for has changed."""
        if self.late is None:
            return [command] * parts
        kept, _, begun = self.late
        if self.off is None:
            self.before, self.off = command, begun * self.directions() * self.unsettled
        self.off = self.off - (command - self.before)
        ends = np.arange(parts + 1) / parts
        # A torque without anything left of e comes to what is asked for along a straight line.
        summed = (1.0 - kept**ends) / -np.log(kept) if kept else ends - ends**2 / 2.0
        given = [command + self.off * share * parts for share in np.diff(summed)]
        self.before, self.off = command, kept * self.off
        return given

    def directions(self):
        return along(self.rng.normal(size=(3, self.lanes)))

    def at_rest(self, angle):
        q = np.concatenate([[np.full(self.lanes, np.cos(angle / 2))], np.sin(angle / 2) * self.directions()])
        return q, np.zeros((3, self.lanes))

    def fly(self, q, w, periods, parts=2):
        """Yield the states between and at samples."""
        around = self.around and self.surroundings(self.around, self.J, self.inverse, self.rng, self.lanes)
        self.off, self.surrounding = None, around
        for n in range(periods):
            unit = self.push(n, q, w)
            if around:
                part, t = self.h / parts, n * self.h
                fast = np.linalg.norm(w + around.target(q, t)[0], axis=0)
                pushed, error = (x + c * fast for x, c in zip((self.outside, self.error), self.growing, strict=True))
                misread = self.misread and self.misread(n, q, w)
                asked_for = around.command(self.law, q, w, t, unit, misread) + self.added * np.sign(unit)
                commands, error = self.acting(asked_for, parts), error * unit
                # Nothing is drawn where there is none, so that other flights stay as they are.
                random = self.rng.normal(scale=self.around.shaken[0], size=w.shape) if self.around.shaken[0] else 0.0 * w
                random = random * np.minimum(1.0, self.around.shaken[1] / np.maximum(np.linalg.norm(random, axis=0), 1e-300))
                for k in range(parts):
                    outside = pushed * unit + around.loaded(unit, fast, part) + random
                    q, w = around.after(q, w, t + (k + 0.5) * part, commands[k] + error, outside, part)
                    # What would exceed the momentum is taken out as it comes in.
                    stored = np.maximum(np.linalg.norm(around.kept, axis=0), 1e-300)
                    around.kept = around.kept * np.minimum(1.0, (self.around.momentum or np.inf) / stored)
                    yield n + 1, q, w
                continue
            command = self.law(q, w) + self.error * unit
            for _ in range(parts):
                q, w = moved(self.J, self.inverse, q, w, command + self.outside * unit, self.h / parts)
                yield n + 1, q, w


def feedback(J, k_rate, k_attitude):
    """The law with which the gyroscopic torque cancels, written once more."""
    J = np.asarray(J, dtype=float)
    return lambda q, w: -k_rate * w - k_attitude * q[1:] + cross(w, J @ w)


def turn(q):
    """The angle of each lane (rad)."""
    return 2 * np.arcsin(np.minimum(np.linalg.norm(q[1:], axis=0), 1.0))
