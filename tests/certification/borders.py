"""From how large starts flights of a loop come home, which are pushed away as hard as a claim allows: with the torque that
its actuators have, into the set of the claim, from where the claim is about them."""

from typing import NamedTuple

import numpy as np

from tests.certification.attack import Attack
from tests.certification.extremal import Leaning
from tests.kernel.flights import along, seen

STARTS, PERIODS, FARTHEST = 40, 2000, 100.0
"""How many starts are flown from, the most periods, and how many times the claimed start the farthest is."""


class Border(NamedTuple):
    """How many times the claimed rate and angle, which is a half turn at most, are of which all flights, and all from nearer
    starts, came home; and of which they did so within the limits of torque and momentum. Below 1 where some did not that
    began as claimed."""

    home: float
    within: float


class Limited(Attack):
    """Flights of a loop whose torque is clipped as its actuators clip it."""

    def __init__(self, content, claim, seed=1, directions=48):
        super().__init__(content, claim, seed, directions * STARTS)
        n = self.numbers
        self.count = sum(name.startswith("motors.") for name in n)
        if self.count:
            # A lost wheel keeps its momentum.
            turned = [k for k in range(self.count) if n[f"motors.{k}"] > 0.0]
            lost = [k for k in range(self.count) if k not in turned]
            axes = np.array([[self.subject[f"wheel.{k}.axis.{i}"] for k in range(self.count)] for i in range(3)])
            begun = np.array([self.subject[f"wheel.{k}.momentum"] for k in range(self.count)])[:, None]
            self.axes, self.begun, self.kept = axes[:, turned], begun[turned], axes[:, lost] @ begun[lost]
            self.motors, self.stored = (
                np.array([n[f"{name}.{k}"] for k in turned])[:, None] for name in ("motors", "stored")
            )
        self.hit = self.over = None

    def clipped(self, u, w, r, H):
        """The torque that there is of one that is asked for; and which lanes ask for more."""
        n = self.numbers
        given = np.clip(u, -n.get("limit", np.inf), n.get("limit", np.inf))
        given = given * np.minimum(1.0, n.get("limit.norm", np.inf) / np.maximum(np.linalg.norm(given, axis=0), 1e-300))
        if self.count:
            back = -np.linalg.pinv(self.axes)
            turning = self.begun + back @ (self.axes @ self.begun - (H - self.true @ (w + r) - self.kept))
            motors = np.clip(back @ given, -self.motors, self.motors)
            self.over |= (np.abs(turning) > self.stored).any(axis=0)
            # A wheel that is full is turned no faster.
            full = (np.abs(turning) >= self.stored) & (np.sign(motors) == np.sign(turning))
            given = -self.axes @ np.where(full, 0.0, motors)
        self.hit |= np.linalg.norm(given - u, axis=0) > 1e-9 * np.linalg.norm(u, axis=0)
        return given

    def home(self, angles, rates):
        """Which flights from these angles and rates, a lane each, come into the set of the claim, and do so unclipped."""
        n, lanes = self.numbers, len(angles)
        self.hit, self.over, fleet = np.zeros(lanes, dtype=bool), np.zeros(lanes, dtype=bool), self.fleet()
        law, V0 = fleet.law, self.lyapunov(np.eye(4)[0], np.zeros(3))
        nearer = "shortest sign" in self.words or "both" in self.claim["theorem"]

        def limited(q, w, *around):
            fed = q * np.where(nearer & (q[0] < 0.0), -1.0, 1.0)
            _, r, _, H = around or [np.zeros(w.shape)] * 4
            return self.clipped(law(fed, w, *around), w, r, H)

        fleet.law = limited
        half, arrived = angles / 2, np.zeros(lanes, dtype=bool)
        begun = np.concatenate([np.cos(half)[None], np.sin(half) * fleet.directions()])
        turning = rates * fleet.directions()
        # Some fly outwards.
        turning[:, ::4] = (rates * along(begun[1:]))[:, ::4]
        if self.count:
            self.load(fleet, law, begun, turning)
        unclipped = np.ones(lanes, dtype=bool)
        for k, q, w in fleet.fly(begun, turning, PERIODS, 1):
            if k % 10 == 0 or k < 10:
                fed = q * np.where(nearer & (q[0] < 0.0), -1.0, 1.0)
                # Wheels that hold more than they can are no flight.
                now = (self.lyapunov(fed, w) - V0 <= n["level"]) & (fed[0] > 0.0) & ~self.over
                unclipped = np.where(now & ~arrived, ~self.hit, unclipped)
                arrived |= now
                if arrived.all():
                    break
        return arrived, arrived & unclipped

    def load(self, fleet, law, begun, turning):
        """Begin every other lane of a start where the law asks for as much of a motor as it does anywhere at that angle and
        rate, with the worst momentum and target, or where a wheel stores as much as it may."""
        n, none, ways = self.numbers, np.zeros((3, self.lanes)), np.arange(self.lanes) % (self.lanes // STARTS)
        pyramid, steered, stored = np.linalg.pinv(self.axes), ways % 2 == 1, ways // 2 % 2 == 1
        rows = (1.0 - 2.0 * (ways // 4 % 2)) * (pyramid / self.motors)[ways // 8 % len(pyramid)].T
        damping, stiffness = self.linear()
        angle, rate = np.linalg.norm(begun[1:], axis=0), np.linalg.norm(turning, axis=0)
        q = np.concatenate([begun[:1], -angle * along(stiffness.T @ rows)])
        w = -rate * np.where(stored, along(self.true.T @ rows), along(damping.T @ rows))

        def steepest(of):
            """The vector that adds most to what is asked for in the direction of each lane's row."""
            return along(np.stack([(rows * (of(none + axis[:, None]) - of(none))).sum(axis=0) for axis in np.eye(3)]))

        momentum = n["momentum"] * np.where(stored, along(rows), steepest(lambda h: law(q, w, none, none, none, h)))
        target = steepest(lambda r: law(q, w, none, r, none, momentum))
        around = Leaning(fleet.around, self.true, fleet.inverse, seen(q * [[1], [-1], [-1], [-1]], target), momentum)
        usual = fleet.surroundings(fleet.around, self.true, fleet.inverse, fleet.rng, self.lanes)
        around.axis, around.kept = (np.where(steered, *pair) for pair in ((around.axis, usual.axis), (momentum, usual.kept)))
        around.phase = np.where(steered, 0.0, usual.phase)
        fleet.surroundings = lambda *_: around
        begun[:, steered], turning[:, steered] = q[:, steered], w[:, steered]

    def border(self):
        """The largest starts from which all flights in all directions came home."""
        n, times = self.numbers, np.geomspace(1.0, FARTHEST, STARTS)
        angle, rate = (n.get(f"start.{name}", n.get(name, 0.0) * (name == "angle")) for name in ("angle", "rate"))
        many = np.repeat(times, self.lanes // STARTS)
        both = self.home(np.minimum(many * angle, np.pi), many * rate)
        return Border(*(self.farthest(times, one) for one in both))

    def farthest(self, times, kept):
        """The largest number up to which all lanes keep to something, 0 where none is."""
        whole = kept.reshape(len(times), -1).all(axis=1)
        count = len(times) if whole.all() else int(np.argmin(whole))
        return float(times[count - 1]) if count else 0.0
