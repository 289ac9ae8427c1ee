"""What drives a loop by a claim, as another reader has it: errors of noise, the motion that they cause in the linear loop,
and fleets of flights under all that acts."""

import math
from functools import cached_property

import numpy as np
from scipy.linalg import expm

from tests.kernel.flights import Fleet, Noise, Surroundings
from tests.kernel.programs import number, run


class Driven:
    """What an oracle knows of them; it has numbers, programs and a claim, the inertia J, and linear()."""

    def errors(self, role):
        """The matrix by which a program multiplies errors and noise."""
        program, zero = self.programs[role], dict.fromkeys(self.programs[role]["inputs"], 0.0)
        names = [f"errors.{k // 3}.{k % 3}" for k in range(len(program["outputs"]) - 6)]
        names += [name for name in zero if name.startswith("noise")]
        return np.array([run(program, zero | {name: 1.0} if name in zero else zero) for name in names]).T

    def noise(self, lanes, rng):
        """Errors that noise drives in many lanes."""
        every, corrected = int(self.numbers["every"]), self.errors("errors corrected")
        carried = self.errors("errors carried") if every > 1 else corrected
        return Noise(carried, corrected, every, lanes, rng)

    def radii(self):
        """Which errors of attitude and rate, and which rates and turns that they cause, are told to be rare."""
        n = self.numbers
        return np.array([n["noise.attitude"], n["noise.rate"], *map(number, self.claim["evidence"]["swayed"])])[:, None]

    def held(self):
        """The motion of (w, q) near rest over a period, and what errors of attitude and rate that the law is told make of
        it; with the torque that acts as a further vector where it lags."""
        (C, K), zero = self.linear(), np.zeros((3, 3))
        N = np.linalg.inv(self.J)
        drift = np.block([[zero, zero, N], [np.eye(3) / 2, zero, zero], [np.zeros((3, 9))]])
        Phi = expm(drift * self.numbers["period"])[:6]
        told, asked, n = np.hstack([K / 2, C]), np.hstack([C, K]), self.numbers
        if "late.torque.moment" not in n:
            return Phi[:, :6] - Phi[:, 6:] @ asked, -Phi[:, 6:] @ told
        # The torque begins as it was, and ends nearer to what is asked for.
        h, (kept, mean, moment) = n["period"], (n[f"late.torque.{name}"] for name in ("kept", "mean", "moment"))
        begun = np.vstack([h * mean * N, h * h / 2 * moment * N])
        ends, both = Phi[:, 6:] - begun, np.hstack([begun.T, kept * np.eye(3)]).T
        later = np.vstack([ends, (1 - kept) * np.eye(3)])
        return np.hstack([np.vstack([Phi[:, :6], np.zeros((3, 6))]) - later @ asked, both]), -later @ told

    def shaken(self):
        """What a torque that is held makes of the motion of (w, q) near rest, in deviations of the random torque."""
        N, zero = np.linalg.inv(self.J), np.zeros((3, 3))
        drift = np.block([[zero, zero, N], [np.eye(3) / 2, zero, zero], [np.zeros((3, 9))]])
        return self.numbers.get("noise.torque.deviation", 0.0) * expm(drift * self.numbers["period"])[:6, 6:]

    def largest_errors(self, samples, maps, begun=2500):
        """The largest errors of attitude and rate in spans of so many samples, once they have settled, and the largest rates
        and turns that they cause in the linear motion, in lanes with maps of their own of (w, q) and of these errors."""
        lanes, (A, B) = len(maps), map(np.array, zip(*maps, strict=True))
        noise, random, shaken = self.noise(lanes, np.random.default_rng(2)), np.random.default_rng(3), self.shaken()
        x, most = np.zeros((A.shape[1], lanes)), np.zeros((4, lanes))
        for k in range(-begun, samples):
            told, rate = noise.told()
            sizes = [np.linalg.norm(part, axis=0) for part in (told, rate, x[:3], x[3:6])]
            x = np.einsum("nij,jn->in", A, x) + np.einsum("nij,jn->in", B, np.concatenate([told, rate]))
            x[:6] += shaken @ random.normal(size=(3, lanes)) if shaken.any() else 0.0
            most = np.maximum(most, sizes) if k >= 0 else most
        return most

    @cached_property
    def slow(self):
        """The slowest rate of the loop near rest."""
        _, stiffness = self.linear()
        return math.sqrt(np.linalg.eigvals(np.linalg.solve(self.J, stiffness)).real.min() / 2)

    def fleet(self):
        """Lanes under all that a pointing claim tells of."""
        n = self.numbers

        def law(q, w, *around):
            given = self.inputs(q, w, *(around or [np.zeros(w.shape)] * 4))[0]
            return run(self.programs["law"], given)[:3]

        found = Fleet(
            self.true, law, n["period"], n["outside"], n["error"], self.slow, int(self.rng.integers(10**6)), self.lanes
        )
        found.added = n.get("memory", 0.0)
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
            self.moving(),
        )  # fmt: skip
        return found

    def moving(self):
        """How errors of what the law is told grow with the motion, if they do."""
        n = self.numbers
        rows = [[n.get(f"error.{told}.per.{of}", 0.0) for of in ("rate", "acceleration")] for told in ("attitude", "rate")]
        count, kept = max(1, int(n.get("error.ago", 0.0) / n["period"])), n.get("error.kept", 0.0)
        return (rows, count, n["period"], kept) if np.any(rows) else None
