"""Certificates of loops near a libration point, and a reading of them in floats that shares no code with the kernel."""

import math
from functools import cache

import numpy as np

from starhold.algebra.vector import ZERO
from starhold.certification.evidence.finding import certificate as contents
from starhold.certification.station import certify_station
from starhold.laws import l2_circle, l2_equilibrium
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.libration_point import PRIMARIES, PointState
from tests.kernel.programs import number, run, written
from tests.making import built, point_loop

PLANT = PRIMARIES["sun-earth"].point("L2")
BEST = l2_circle.design(PLANT, l2_circle.Best(1.0))
SOFT = BEST._replace(feedback=1, k=0.3, boundary_layer=0.1)
REST = l2_equilibrium.design(PLANT, l2_equilibrium.Degree(y=1.0, z=-0.5))


def loop_of(gains=BEST, limit=math.inf, kind="norm", plant=PLANT, **changes):
    """A loop that starts where the law leads."""
    if isinstance(gains, l2_circle.Gains):
        law, start = "l2-circle", PointState((0.0, gains.radius, 0.0), (0.0, 0.0, gains.rate * gains.radius), ZERO)
    else:
        law, start = "l2-equilibrium", PointState((0.0, gains.y, gains.z), ZERO, ZERO)
    law = catalogue("libration-point")[law]
    return point_loop(plant, law, gains, start, 1e-3, limit=limit, kind=kind, **changes)


@cache
def flown(scenario, law):
    """The certificate of a law of a built-in scenario."""
    return certify_station(built(scenario, law), law)


def proof(certificate, *kept):
    """What the kernel is given, with the claims at these places."""
    proofs = [certificate.proofs[k] for k in kept] if kept else certificate.proofs
    return contents([program for one in proofs for program in one.programs.values()], [one.claim for one in proofs])


class StationOracle:
    """It looks at the equations at random states, and at no evidence."""

    def __init__(self, content, claim, seed=0):
        self.theorem, self.rng = claim["theorem"], np.random.default_rng(seed)
        self.programs = {role: written(content["programs"][name]) for role, name in claim["programs"].items()}
        self.numbers = {name: number(x) for name, x in claim["numbers"].items()}
        self.subject = {name: number(x) for name, x in claim["subject"].items()}

    def read(self, role, x, v, **more):
        given = self.subject | more
        for k in range(3):
            for name, value in (("position", x), ("velocity", v)):
                given[f"{name}.{k}"] = given[f"measurement.{name}.{k}"] = float(value[k])
        return run(self.programs[role], given)

    def acceleration(self, x, v):
        return self.read("field", x, v) + self.read("law", x, v)

    def along(self, role, x, v, step=1e-6):
        """The derivative of a function of the state along the motion."""
        a = self.acceleration(x, v)
        return (self.read(role, x + step * v, v + step * a) - self.read(role, x - step * v, v - step * a)) / (2.0 * step)

    def holds(self):
        return getattr(self, "_" + self.theorem.replace(" ", "_"))()

    def circle(self):
        """Square of the radius and rate; no numbers where the errors are not those of a circle."""
        zero = np.zeros(3)
        c, rate = -self.read("errors", zero, zero)[0], self.read("errors", np.array([0.0, 0.0, 1.0]), zero)[1]
        for _ in range(20):
            x, v = self.rng.normal(size=(2, 3))
            wanted = (x[1] ** 2 + x[2] ** 2 - c, v[1] + rate * x[2], v[2] - rate * x[1])
            if not np.allclose(self.read("errors", x, v), wanted, atol=1e-9):
                return math.nan, math.nan
        return c, rate

    def _ends_on_the_circle(self):
        n, (c, rate) = self.numbers, self.circle()
        level, zero, most = n["level"], np.zeros(3), n.get("limit.norm", n.get("limit.axis"))
        if not (c > 0.0 and rate != 0.0 and self.read("lyapunov", zero, zero)[0] > level > 0.0):
            return False
        fell, seen = [], 0
        for _ in range(30_000):
            if seen >= 150:
                break
            r, turn = math.sqrt(c * self.rng.uniform(0.0, 2.2)), self.rng.uniform(0.0, 2.0 * math.pi)
            x = np.array([0.0, r * math.cos(turn), r * math.sin(turn)])
            size, off = math.sqrt(2.0 * level) * self.rng.uniform(), self.rng.uniform(0.0, 2.0 * math.pi)
            v = np.array([0.0, size * math.cos(off) - rate * x[2], size * math.sin(off) + rate * x[1]])
            height = self.read("lyapunov", x, v)[0]
            if height < -1e-9:
                # As V falls, the motion does not end where V is zero.
                return False
            if height > level:
                continue
            seen += 1
            u = self.read("law", x, v)
            if most is not None and (np.linalg.norm(u) if "limit.norm" in n else np.abs(u).max()) > most * (1.0 + 1e-9):
                return False
            x[0], v[0] = self.rng.normal(size=2) * (most is None)
            fell.append(self.along("lyapunov", x, v)[0])
        for r in (n["inner"], n["outer"]):
            if self.read("lyapunov", np.array([0.0, r, 0.0]), np.array([0.0, 0.0, rate * r]))[0] > level * (1.0 + 1e-9):
                return False
        r = math.sqrt(c)
        off = self.read("lyapunov", np.array([0.0, r, 0.0]), np.array([0.0, n["velocity"], rate * r]))[0]
        return off <= level * (1.0 + 1e-9) and seen > 20 and max(fell) < 1e-7 and self._x_returns()

    def slopes(self, at):
        """The derivatives of the acceleration with respect to the state."""
        found = []
        for k in range(6):
            state = np.array([at, at], dtype=float)
            state[:, k] += (1e-4, -1e-4)
            found.append(
                (self.acceleration(state[0, :3], state[0, 3:]) - self.acceleration(state[1, :3], state[1, 3:])) / 2e-4
            )
        return np.array(found).T

    def _x_returns(self):
        found = self.slopes([0.0, 0.7, 0.4, 0.0, 0.1, 0.2])[0]
        return bool(found[0] < 0.0 and found[3] < 0.0 and np.abs(found[[1, 2, 4, 5]]).max() < 1e-6)

    def _comes_to_rest(self):
        place = np.append(run(self.programs["rest"], self.subject), np.zeros(3))
        flow = np.vstack([np.eye(6)[3:], self.slopes(place)])
        state = np.append(place[:3] + self.rng.normal(size=3), self.rng.normal(size=3))
        linear = np.allclose(self.acceleration(state[:3], state[3:]), flow[3:] @ (state - place), atol=1e-5)
        return bool(linear and np.linalg.eigvals(flow).real.max() < 0.0)

    def _returns_with_limited_control(self):
        n, place = self.numbers, run(self.programs["rest"], self.subject)

        def moved(x, v):
            state = np.array([x, *place[1:]]), np.array([v, 0.0, 0.0])
            asks = {f"command.{k}": u for k, u in enumerate(self.read("law", *state))}
            acts = run(self.programs["limited"], self.subject | asks | {"limit": n["limit"]})
            return self.read("field", *state)[0] + acts[0]

        def pulled(x):
            return self.read("field", np.array([x, *place[1:]]), np.zeros(3))[0]

        if np.abs(self.read("law", place, np.zeros(3))[1:]).max() > n["limit"] * (1.0 + 1e-12):
            return False
        s = math.sqrt(pulled(1.0))
        for _ in range(300):
            share, part = self.rng.uniform(0.01, 1.0), self.rng.uniform(-1.0, 1.0)
            S, x = share * n["width"] * self.rng.choice([-1, 1]), share * n["reach"] * part
            v = s * (S - x)
            if S * (v + moved(x, v) / s) >= 0.0:
                return False
            x = share * n["reach"] * self.rng.choice([-1, 1])
            if x * s * (part * share * n["width"] - x) >= 0.0:
                return False
            x, side = n["boundary"] * self.rng.normal(), self.rng.choice([-1, 1])
            v = s * (side * n["boundary"] * (1.0 + 1e-9) - x)
            if side * (v + moved(x, v) / s) <= -1e-6:
                return False
        return pulled(n["boundary"]) >= n["limit"] * (1.0 - 1e-12)

    def _needs_more_control_on_the_circle(self):
        n, (_, rate) = self.numbers, self.circle()
        x, v = np.array([0.0, n["y"], n["z"]]), np.array([0.0, -rate * n["z"], rate * n["y"]])
        u = self.read("law", x, v)
        size = np.linalg.norm(u) if "limit.norm" in n else np.abs(u).max()
        there = np.abs(self.read("errors", x, v)).max() < 1e-9
        return bool(there and size * (1 + 1e-12) >= n["control"] > n.get("limit.norm", n.get("limit.axis")))

    def _does_not_return(self):
        slopes = self.slopes([0.1, 0.7, 0.4, 0.3, 0.1, 0.2])
        alone = [k for k in range(3) if np.abs(np.delete(slopes[k], [k, k + 3])).max() < 1e-6]
        return any(max(slopes[k, k], slopes[k, k + 3]) > -1e-6 for k in alone)

    def _holds_another_circle(self):
        """Just beside the circle in every direction what the relay takes off turns the error round."""
        n, (c, rate) = self.numbers, self.circle()
        r = n["radius"]
        for turn in self.rng.uniform(0.0, 2.0 * math.pi, 8):
            x = np.array([0.0, r * math.cos(turn), r * math.sin(turn)])
            if abs(self.acceleration(x, np.array([0.0, -rate * x[2], rate * x[1]]))[0]) > 1e-9:
                return False
            for off in np.linspace(0.0, 2.0 * math.pi, 9):
                e = 1e-5 * np.array([math.cos(off), math.sin(off)])
                v = np.array([0.0, e[0] - rate * x[2], e[1] + rate * x[1]])
                if self.along("errors", x, v, 1e-9)[1:] @ e > 1e-7 * n["of"]:
                    return False
        return abs(r * r - c) > 0.0 and n["needs"] <= n["of"]
