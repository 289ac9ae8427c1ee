"""Tries in floats whether what a claim says is true of its programs: another reading of both, which shares no code with the
kernel. It looks at the equations at random states, and at no evidence."""

import math
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from tests.kernel.driven import Driven
from tests.kernel.flights import cross, rates, stepped, turn
from tests.kernel.planned import Planned
from tests.kernel.programs import number, run, written

STEP = 1e-6


def turned(rng, least=-1.0):
    """A random quaternion with q0 >= least."""
    while True:
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        if q[0] >= least:
            return q


class Oracle(Driven):
    """`J` is the inertia that the claim gives, `true` that of the body, which differs from it by the claim's tolerance."""

    def __init__(self, content, claim, seed=0):
        self.claim, self.rng = claim, np.random.default_rng(seed)
        self.programs = {role: written(content["programs"][name]) for role, name in claim["programs"].items()}
        self.numbers = {name: number(x) for name, x in claim["numbers"].items()}
        self.subject = {name: number(x) for name, x in claim["subject"].items()}
        self.any = "whatever" in claim["theorem"]
        if self.any:
            half = self.rng.normal(size=(3, 3))
            self.J = half @ half.T + np.eye(3)
        else:
            self.J = np.array([[self.subject[f"body.inertia.{min(i, k)}.{max(i, k)}"] for k in range(3)] for i in range(3)])
        if "near the inertia" in claim["theorem"]:
            self.J = self.near(self.J)
        self.true = self.near(self.J) if claim["theorem"] == "points" and "tolerance" in self.numbers else self.J
        # How much is in a memory.
        self.words, self.kept = claim["taken"], 0.0

    def near(self, J):
        """An inertia no entry of which is off by more than is told."""
        reach = self.numbers["tolerance"] * np.sqrt(np.outer(np.diagonal(J), np.diagonal(J)))
        for _ in range(1000):
            half = np.triu(self.rng.choice([-1.0, 1.0]) * self.rng.uniform(0.5, 1.0, size=(3, 3)))
            found = J + reach * (half + np.triu(half, 1).T)
            if np.linalg.eigvalsh(found)[0] > 0.0:
                return found
        return J

    def bounded(self, name, word, default=1.0):
        if word not in self.words:
            return np.zeros(3)
        found = self.rng.normal(size=3)
        return found / np.linalg.norm(found) * self.numbers.get(name, default)

    def outside(self):
        if "outside torque" not in self.words:
            return np.zeros(3)
        return np.array([self.rng.choice([-1, 1]) * self.numbers.get(f"outside.{k}", 1e-3) for k in range(3)])

    def inputs(self, q, w, e, r, a, H):
        h = H - self.true @ (w + r) if "wheels" in self.words else np.zeros(np.shape(w))
        told = {
            "attitude": q, "rate": w, "body_rate": w + r, "target_rate": r, "target_acceleration": a - cross(w, r),
            "external_torque": e, "position": self.rng.normal(size=3), "wheel_momentum": h,
            "magnetic_field": self.rng.normal(size=3),
        }  # fmt: skip
        given = dict(self.subject)
        for field, value in told.items():
            given |= {f"measurement.{field}.{k}": x for k, x in enumerate(value)}
        kept = [name for name in self.programs.get("law", {"inputs": []})["inputs"] if name.startswith("memory.")]
        given |= {name: self.rng.choice([-1.0, 1.0], np.shape(w)[1:]) * self.kept for name in kept}
        return given, h

    @cached_property
    def plant(self):
        inverse = np.linalg.inv(self.J)
        found = {f"craft.inertia.{i}.{k}": self.J[i, k] for i in range(3) for k in range(3)}
        found |= {f"craft.inverse_inertia.{i}.{k}": inverse[i, k] for i in range(3) for k in range(3)}
        return found

    def law(self, q, w, e, r, a, H):
        given, h = self.inputs(q, w, e, r, a, H)
        u = run(self.programs["law"], given)[:3]
        return u, u + e - np.cross(w + r, self.J @ (w + r) + h) - self.J @ (a - cross(w, r)), h

    def lyapunov(self, q, w):
        given, _ = self.inputs(q, w, *[np.zeros(np.shape(w))] * 4)
        return run(self.programs["lyapunov"], given | self.plant)[0]

    def slope(self, q, w, T):
        qd = 0.5 * np.concatenate([[-w @ q[1:]], q[0] * w + np.cross(q[1:], w)])
        wd = np.linalg.solve(self.J, T)
        rate = max(np.linalg.norm(qd), np.linalg.norm(wd) / max(np.linalg.norm(w), 1e-3), 1e-12)
        h = STEP / rate
        return (self.lyapunov(q + h * qd, w + h * wd) - self.lyapunov(q - h * qd, w - h * wd)) / (2 * h), rate

    def environment(self):
        r, a = self.bounded("target.rate", "moving target"), self.bounded("target.acceleration", "moving target")
        return self.outside(), r, a, self.bounded("momentum", "wheels")

    def holds(self, tries=40):
        """Whether nothing against the claim was found."""
        return self.body() and getattr(self, self.claim["theorem"].split()[0])(tries)

    def body(self):
        for _ in range(3):
            w, t, q = self.rng.normal(size=3), self.rng.normal(size=3), self.rng.normal(size=4)
            given = (
                self.subject | self.plant | {f"rate.{k}": w[k] for k in range(3)} | {f"torque.{k}": t[k] for k in range(3)}
            )
            wanted = np.linalg.solve(self.J, t - np.cross(w, self.J @ w))
            flat = {f"craft.inertia.{k}": self.J[k, k] for k in range(3)}
            if not np.allclose(run(self.programs["body"], flat | given), wanted, rtol=1e-6, atol=1e-12):
                return False
            given = {f"rate.{k}": w[k] for k in range(3)} | {f"q.{k}": q[k] for k in range(4)}
            wanted = 0.5 * np.concatenate([[-w @ q[1:]], q[0] * w + np.cross(q[1:], w)])
            if not np.allclose(run(self.programs["turning"], given), wanted, rtol=1e-9):
                return False
        return bool(np.linalg.eigvalsh(self.J)[0] > 0)

    def converges(self, tries):
        zero, level = np.zeros(3), self.numbers.get("level")
        target, even = np.eye(4)[0], "both" in self.claim["theorem"]
        V0 = self.lyapunov(target, zero)
        wide = self.lyapunov(np.array([0.0, 1.0, 0.0, 0.0]), zero) - V0 if level is None else level
        if wide <= 0:
            return False
        for _ in range(tries):
            q, w = turned(self.rng), self.rng.normal(size=3)
            # As large a rate as the set holds, or one of the size that the potential gives.
            moving = self.lyapunov(target, w) - V0
            if moving <= 0:
                return False
            w *= math.sqrt(wide / moving) * self.rng.uniform(0.1, 1.0)
            if level is not None:
                share = self.rng.uniform()
                q = self.shrunk(q, V0, level * share)
                w *= math.sqrt(max(1.0 - share, 0.0))
            if level is not None and self.lyapunov(q, w) - V0 > level:
                continue
            if not self.state(q, w, V0, level):
                return False
        if not even and level is None and self.rests_elsewhere(wide):
            return False
        return self.sign(V0, level, even) and self.contents(V0, level)

    def rests_elsewhere(self, wide):
        """Whether there is an attitude off target without a torque, among those that are fed back."""
        least = -self.numbers.get("hysteresis", 1.0)

        def torque(x):
            return self.law(x / np.linalg.norm(x), np.zeros(3), *[np.zeros(3)] * 4)[1] / wide

        for _ in range(8):
            x = least_squares(torque, turned(self.rng), ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=60).x
            q = x / np.linalg.norm(x)
            if np.linalg.norm(torque(x)) < 1e-7 and np.linalg.norm(q[1:]) > 0.05 and q[0] >= least:
                return True
        return False

    def shrunk(self, q, V0, most):
        """A state at rest turned less, until V is as low."""
        for _ in range(60):
            if self.lyapunov(q, np.zeros(3)) - V0 <= most:
                return q
            q = np.concatenate([[q[0] + 0.2 * (1 - q[0])], 0.8 * q[1:]])
            q /= np.linalg.norm(q)
        return np.eye(4)[0]

    def state(self, q, w, V0, level):
        if self.lyapunov(q, w) <= V0:
            return False
        torques, size = [], 0.0
        for _ in range(3):
            *others, H = self.environment()
            u, T, h = self.law(q, w, *others, H)
            torques.append((T, np.cross(w, H)))
            size = max(size, np.abs(u).max() + np.abs(T).max())
            if not self.limits(u, h):
                return False
        plain, idle = map(np.array, zip(*torques, strict=True))
        ways = [plain]
        if not {"outside torque", "moving target"} & set(self.words):
            # With nothing from outside momentum is constant in the target's axes; a law may undo a share of what it does.
            moved, turned = plain[1] - plain[0], idle[1] - idle[0]
            ways.append(plain - idle * (moved @ turned) / max(turned @ turned, 1e-300))
        alike = [own[0] for own in ways if np.allclose(own, own[0], rtol=1e-6, atol=1e-9 * size)]
        if not alike:
            return False
        slope, rate = self.slope(q, w, alike[0])
        # Differences are rounded.
        return slope <= 1e-7 * (abs(self.lyapunov(q, w)) + abs(V0)) * rate / STEP * 1e-2

    def limits(self, u, h):
        n, more = self.numbers, 1 + 1e-7
        if "limit" in n and np.abs(u).max() > n["limit"] * more:
            return False
        if "limit.norm" in n and np.linalg.norm(u) > n["limit.norm"] * more:
            return False
        if "motors.0" not in n:
            return True
        count = sum(name.startswith("motors") for name in n)
        A = np.array([[self.subject[f"wheel.{k}.axis.{i}"] for k in range(count)] for i in range(3)])
        begun = np.array([self.subject[f"wheel.{k}.momentum"] for k in range(count)])
        L = -np.linalg.pinv(A)
        kept = begun + L @ (A @ begun)
        most = [np.array([n[f"{name}.{k}"] for k in range(count)]) for name in ("motors", "stored")]
        return bool((np.abs(L @ u) <= most[0] * more).all() and (np.abs(kept - L @ h) <= most[1] * more).all())

    def sign(self, V0, level, even):
        zero, other = np.zeros(3), -np.eye(4)[0]
        if "hysteresis" in self.words:
            width = self.numbers["hysteresis"]
            states = [turned(self.rng) for _ in range(300)]
            lower = [self.lyapunov(q, zero) > self.lyapunov(-q, zero) for q in states if q[0] < -width]
            return 0 < width < 1 and all(lower)
        if "shortest sign" in self.words or (even and level is not None):
            halves = [turned(self.rng) * [0, 1, 1, 1] for _ in range(100)]
            halves, lean = [q / np.linalg.norm(q) for q in halves], self.numbers.get("lean", 0.0)
            return all(self.lyapunov(q, -lean * q[1:]) - V0 > level for q in halves)
        if even:
            return True
        if level is not None and self.lyapunov(other, zero) - V0 > level:
            return True
        return level is None or all(self.lyapunov(other, zero) > self.lyapunov(turned(self.rng), zero) for _ in range(30))

    def contents(self, V0, level):
        n, zero = self.numbers, np.zeros(3)
        for _ in range(100):
            axis = self.rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            if "angle" in n:
                half = min(n["angle"] / 2, math.pi)
                q = np.concatenate([[math.cos(half)], math.sin(half) * axis])
                if self.lyapunov(q, zero) - V0 > level * (1 + 1e-9):
                    return False
            if "rate" in n and self.lyapunov(np.eye(4)[0], n["rate"] * axis) - V0 > level * (1 + 1e-9):
                return False
            if "start.rate" in n:
                half = min(n["start.angle"] / 2, math.pi)
                q = np.concatenate([[math.cos(half)], math.sin(half) * axis])
                if self.lyapunov(q, n["start.rate"] * self.direction()) - V0 > level * (1 + 1e-9):
                    return False
            if "fastest" in n:
                w = axis * math.sqrt(level / (self.lyapunov(np.eye(4)[0], axis) - V0))
                if np.linalg.norm(w) > n["fastest"] * (1 + 1e-9):
                    return False
        return True

    def direction(self):
        found = self.rng.normal(size=3)
        return found / np.linalg.norm(found)

    def linear(self):
        """Damping and stiffness near rest."""
        rest, zero, size = np.eye(4)[0], np.zeros(3), 1e-9

        def u(q, w):
            return self.law(np.concatenate([[1.0], q]), w, *[zero] * 4)[0]

        if not np.allclose(self.law(rest, zero, *[zero] * 4)[0], 0.0, atol=1e-15):
            return None
        C, K = ([-u(*pair) / size for pair in pairs] for pairs in (
            [(zero, size * axis) for axis in np.eye(3)], [(size * axis, zero) for axis in np.eye(3)]))  # fmt: skip
        return np.array(C).T, np.array(K).T

    def stays(self, tries):
        found, n = self.linear(), self.numbers
        if found is None:
            return False

        def radius(h):
            held = np.linalg.solve(self.J, np.hstack(found))
            step = np.block([[np.eye(3), np.zeros((3, 3))], [h / 2 * np.eye(3), np.eye(3)]])
            return np.abs(np.linalg.eigvals(step - np.vstack([h * held, h * h / 4 * held]))).max()

        longest = [radius(h) for h in np.geomspace(1e-3, 1, 30) * n["longest"]] if "longest" in n else []
        return radius(n["period"]) <= n["radius"] * (1 + 1e-9) and n["radius"] < 1 and all(x < 1 + 1e-9 for x in longest)

    def points(self, tries):
        """Whether nothing leaves what is claimed in flights under pushes that are chosen against it."""
        n, zero = self.numbers, np.zeros(3)
        V0, level = self.lyapunov(np.eye(4)[0], zero), n["level"]
        if "share" in n:
            most, radii = self.largest_errors(int(min(n["samples"], 2500)), [self.held()] * 500), self.radii()[:4]
            if (most > radii).any(axis=0).mean() > n["share"] + 4 * math.sqrt(n["share"] / 500):
                return False

        if "plan" in self.words and not self.plans(tries):
            return False

        self.lanes = 2 * tries
        fleet = self.fleet()
        # What is in a memory is drawn here, in place of what it adds. Of plans the program flies, which `plans` checks: how
        # far they may be from it shrinks with the state.
        self.kept, fleet.added = 1e9, 0.0
        states = [self.border(V0, level * self.rng.uniform()) for _ in range(tries)]
        states += [(self.shrunk(turned(self.rng), V0, level * 10.0 ** self.rng.uniform(-6, 0)), zero) for _ in range(tries)]
        start = (np.array(part).T for part in zip(*states, strict=True))
        periods = min(int(n["settling"] / n["period"]), 3000)
        for k, q, w in fleet.fly(*start, periods + 300):
            if (self.lyapunov(q, w) - V0 > n["highest"]).any() or (
                k == 1 and np.abs(fleet.law(q, w)).max() > n.get("limit", np.inf)
            ):
                return False
            off = (turn(q) > n["end.angle"]) | (np.linalg.norm(w, axis=0) > n["end.rate"])
            if k * n["period"] > n["settling"] and off.any():
                return False
        return self.contents(V0, level)

    def plans(self, tries):
        """Whether no best plan is against what is claimed of it."""
        states = [self.border(0.0, self.numbers["level"] * self.rng.uniform()) for _ in range(tries)]
        q, w = (np.array(part).T for part in zip(*states, strict=True))
        told, _ = self.inputs(q, w, *[np.zeros(w.shape)] * 4)
        return Planned(self.subject, self.numbers, self.J).holds(run(self.programs["law"], told)[:3], q, w, self.rng)

    def border(self, V0, rest):
        """A state of the set's border, of which rest is the part of V that it has at rest."""
        q, w = self.shrunk(turned(self.rng), V0, rest), self.direction()
        low, high = 0.0, 1.0
        while self.lyapunov(q, high * w) - V0 < self.numbers["level"]:
            high *= 2.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self.lyapunov(q, middle * w) - V0 <= self.numbers["level"] else (low, middle)
        return q, low * w

    def reaches(self, tries):
        n, J = self.numbers, self.J
        zero = np.zeros(3)

        def surface(q, w):
            return run(self.programs["surface"], self.inputs(q, w, *[zero] * 4)[0])

        K = np.array([surface(np.concatenate([[0.0], axis]), zero) for axis in np.eye(3)]).T
        if np.linalg.eigvalsh(K + K.T)[0] <= 0:
            return False
        layer = np.array([n.get(f"far.{k}", 0.0) for k in range(3)])
        for _ in range(tries):
            q, w = turned(self.rng), self.rng.normal(size=3) * 10.0 ** self.rng.uniform(-4, 0)
            s = surface(q, w)
            if not np.allclose(s, w + K @ q[1:], rtol=1e-9):
                return False
            for _ in range(4):
                T = self.law(q, w, *self.environment())[1]
                moved = T + J @ (K @ (0.5 * (q[0] * w + np.cross(q[1:], w))))
                if any(s[k] * moved[k] >= 0 for k in range(3) if abs(s[k]) > max(layer[k], 1e-12)):
                    return False
        moments = np.linalg.eigvalsh(J)
        k, size = np.linalg.eigvalsh(K + K.T)[0] / 2, math.sqrt(moments[-1] / moments[0] * (layer**2).sum())
        if "end.angle" in n and not (
            math.sin(min(n["end.angle"], 3.0) / 2) > size / k and n["end.rate"] > size * (1 + np.linalg.norm(K, 2) / k)
        ):
            return False
        if "end.angle" in n and not self.ends():
            return False
        return "level" not in n or 2 * n["level"] < moments[0] * k * k

    def ends(self):
        """Whether motions end as near the target as told, while torques from outside change sides now and then."""
        n, inverse, zero = self.numbers, np.linalg.inv(self.J), np.zeros((3, 16))
        damping, stiffness = self.linear()
        fast = np.abs(np.linalg.eigvals(inverse @ damping)).max()
        slow = np.abs(np.linalg.eigvals(np.linalg.solve(damping, stiffness))).min() / 2
        corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8) * [[n[f"outside.{k}"]] for k in range(3)]
        (q, w), h = (np.tile(np.eye(4)[0], (16, 1)).T, zero), 1 / fast
        steps = min(int(4 / slow / h), 2000)
        for k in range(3 * steps):
            # The first half of them changes sides.
            e = corners[:, np.arange(16) % 8] * np.where(np.arange(16) < 8, (-1) ** (k // steps), 1)

            def slope(q, w, e=e):
                return rates(self.J, inverse, q, w, e + run(self.programs["law"], self.inputs(q, w, *[zero] * 4)[0]))

            q, w = stepped(slope, (q, w), h)
            if k > steps and ((turn(q) > n["end.angle"]).any() or (np.linalg.norm(w, axis=0) > n["end.rate"]).any()):
                return False
        return True


def is_kept(content, claim):
    """Whether nothing in twelve tries breaks a claim: what is asked of a changed certificate that the kernel accepts."""
    return Oracle(content, claim).holds(12)
