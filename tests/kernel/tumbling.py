"""Flies claims about detumbling in floats, from states and with torques and changes of the field that are sought to break
them. What the rods make of the law's torque, and the energy, stand here a second time."""

from types import SimpleNamespace

import numpy as np

from starhold.kernel.numbers import rational
from starhold.trace.straight_line import evaluated
from tests.kernel.flights import along, cross, seen, stepped

SUBSTEPS, PERIODS = 6, 4
SLACK = 1e-9
"""Of the kinetic energy, for floats."""


class Tumbling:
    """The flights of one claim; `broken` and `tight` tell what became of them."""

    def __init__(self, content, claim, seed=0, lanes=150, beyond=None):
        self.programs = {role: content["programs"][name] for role, name in claim["programs"].items()}
        self.subject, self.numbers = (
            {name: float(rational(x)) for name, x in claim[part].items()} for part in ("subject", "numbers")
        )
        # What acts, where that is to be more than the claim is told.
        self.acts = self.numbers | (beyond or {})
        self.random, self.lanes = np.random.default_rng(seed), lanes
        self.wheels = "wheels" in claim["taken"]
        J = [[self.subject[f"body.inertia.{min(i, k)}.{max(i, k)}"] for k in range(3)] for i in range(3)]
        self.J = np.array(J)
        inverse = np.linalg.inv(self.J)
        craft = {name.partition(".")[2]: x for name, x in self.subject.items() if name.startswith("craft.")}
        self.craft = SimpleNamespace(**craft)
        self.plant = SimpleNamespace(inertia=self.J.tolist(), inverse_inertia=inverse.tolist())
        self.highest, self.broken = 0.0, 0

    @property
    def levels(self):
        return sum(name.startswith("rate.") for name in self.numbers)

    def holds(self, rounds=3):
        """Whether no flight breaks the claim."""
        J = self.J
        if np.linalg.eigvalsh(J)[0] <= 0.0 or np.abs(J - J.T).max() > 0.0:
            return False
        return all(self.search(level, rounds) for level in range(self.levels))

    def search(self, level, rounds=3):
        """Fly random states at a level, and then others near those that came closest to a breach."""
        states = self.draw(level)
        for _ in range(rounds):
            breach = self.fly(level, states)
            if (breach > 1.0).any():
                self.broken += int((breach > 1.0).sum())
                return False
            best = np.argsort(-breach)[: self.lanes // 10]
            near = np.tile(states[:, best], 10)[:, : self.lanes]
            states = near * (1.0 + 0.03 * self.random.normal(size=near.shape))
        return True

    def draw(self, level):
        """Draw rates, fields, how these change and what acts, as numbers that are read by `fly`."""
        return self.random.normal(size=(19, self.lanes))

    def fly(self, level, x):
        """Return how far each flight comes to a breach in one of its periods: 1 is one."""
        n, s, h = self.numbers, self.acts, self.subject["measurement.period"]
        limit, above, rise, often, fall = (n[f"{name}.{level}"] for name in ("rate", "above", "rise", "often", "fall"))
        count = x.shape[1]
        q = np.zeros((4, count))
        q[0] = 1.0
        strength = s["field.least"] * (1.0 + np.abs(x[18]) * (x[18] > 0.0))
        B = along(x[:3]) * strength
        # Rates mostly along the field, where little opposes them, and as fast as may be.
        share = np.exp(1.5 * x[3] - 1.5)
        w = along(along(B) * np.sign(x[4]) + share * x[5:8]) * limit * (1.0 - 0.02 * np.abs(x[8]))
        stored = along(x[9:12]) * s["stored"] if self.wheels else np.zeros((3, count))
        kind = np.sign(x[15])
        memory, known, dipole = np.zeros((3, count)), 0.0, np.zeros((3, count))
        breach, fastest = np.zeros(count), [np.zeros(count)]
        sights = []
        for k in range(PERIODS):
            if k:
                # Against the way in which the field turns in the body, or another one.
                apparent = -cross(B / np.linalg.norm(B, axis=0), self.inertial(q, w))
                way = along(np.where(x[16] > 0.0, along(apparent) * np.sign(x[17]), 0.0) + 0.3 * x[12:15])
                B = B + way * s["field.change"] * h * np.linalg.norm(B, axis=0) / (1.0 + s["field.change"] * h)
                size = np.linalg.norm(B, axis=0)
                B = B * np.maximum(1.0, s["field.least"] / size)
            f = seen(q, B)
            torque, memory, known = self.command(f, memory, known)
            dipole = cross(f, torque) / (f * f).sum(axis=0)
            dipole = dipole / np.maximum(1.0, np.abs(dipole).max(axis=0) / s["dipole.limit"])
            before, energy = q, self.energy(w)
            q, w, most = self.carried(q, w, B, dipole, stored, kind, h)
            fastest.append(np.maximum(most, 0.0))
            sights.append((before, B))
            if k >= 2:
                last, _ = sights[k - 1]
                b = B / np.linalg.norm(B, axis=0)
                m = np.linalg.norm(seen(q, b) - seen(last, b), axis=0) / (2.0 * h)
                slow = np.maximum.reduce(fastest[-3:]) <= limit
                gained = (self.energy(w) - energy) / h - SLACK * energy / h
                rising = np.maximum(gained / rise if rise > 0.0 else 2.0 * (gained > 0.0), 0.0)
                falls = np.where(gained > np.where(m > often, -fall, 0.0), 2.0, 0.0)
                breach = np.maximum(breach, np.where(slow, np.where(m > above, falls, rising), 0.0))
        self.highest = max(self.highest, float(breach.max()))
        return breach

    def inertial(self, q, v):
        return seen(np.vstack([q[:1], -q[1:]]), v)

    def energy(self, w):
        return 0.5 * (w * (self.J @ w)).sum(axis=0)

    def command(self, f, memory, known):
        measurement = SimpleNamespace(magnetic_field=f, period=self.subject["measurement.period"], attitude=(1.0, 0, 0, 0))
        gains = SimpleNamespace(k=self.subject["gains.k"])
        given = {"measurement": measurement, "gains": gains, "craft": self.craft}
        out = evaluated(self.programs["law"], memory=SimpleNamespace(field=memory, known=known), **given)
        columns = [np.broadcast_to(np.asarray(part, dtype=float), f[0].shape) for part in out]
        return np.array(columns[:3]), np.array(columns[3:6]), columns[6]

    def carried(self, q, w, B, dipole, stored, kind, h):
        """Carry a state over a period; with the largest rate. What acts from outside does so as the body turns."""
        step, most, s = h / SUBSTEPS, np.linalg.norm(w, axis=0), self.acts

        def rates(q, w):
            f = seen(q, B)
            across = w - along(f) * (along(f) * w).sum(axis=0)
            pushed = along(w) * s["outside"] + along(across) * s["outside.across"]
            torque = cross(dipole, f) + np.where(kind > 0.0, 1.0, 0.2) * pushed - cross(w, stored)
            out = evaluated(self.programs["body"], rate=w, torque=torque, craft=self.plant)
            turn = 0.5 * np.vstack([-(q[1:] * w).sum(axis=0), q[0] * w + cross(q[1:], w)])
            return turn, np.array([np.broadcast_to(part, w[0].shape) for part in out])

        for _ in range(SUBSTEPS):
            q, w = stepped(rates, (q, w), step)
            most = np.maximum(most, np.linalg.norm(w, axis=0))
        return q, w, most
