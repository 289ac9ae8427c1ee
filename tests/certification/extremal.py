"""The worst flight that is known of a loop near a target that turns: the momentum stays across the turn, where r x H leans
the body as far as it can, and every bounded push turns over as the impulse response in the direction of the lean does."""

import numpy as np

from tests.certification.pointing_hunt import Attack
from tests.kernel import flights
from tests.kernel.flights import along, cross, turn


class Leaning(flights.Around):
    """A target that turns as fast as it may, with the largest momentum across its axis."""

    def __init__(self, *given):
        super().__init__(*given)
        self.phase[:] = 0.0
        if self.bounds.momentum is not None:
            self.kept = self.bounds.momentum * along(cross(self.axis, self.kept))


def reached(content, claim, periods, lanes, seed=1):
    """The largest angle of such flights from on target, as a share of the claimed one."""
    attack = Attack(content, claim, seed, lanes)
    fleet, n, lean = attack.fleet(), attack.numbers, np.linalg.inv(attack.linear()[1])
    A, B = attack.step()
    last = int(12.0 / (attack.slow * n["period"]))
    ways = [np.vstack([np.zeros((3, 3)), np.eye(3)])]
    for _ in range(last - 1):
        ways.append(A.T @ ways[-1])
    responses, around, way = [B.T @ one for one in reversed(ways)], [], np.tile(np.eye(3)[:, 2:], (1, lanes))

    class Kept(Leaning):
        def __init__(self, *given):
            super().__init__(*given)
            around.append(self)

    def push(k, q, w):
        nonlocal way
        if k % last == 0 and n.get("momentum"):
            leant = -lean @ cross(around[0].target(q, k * n["period"])[0], around[0].kept)
            way = along(leant) if np.abs(leant).max() > 1e-9 else way
        return along(responses[k % last] @ way)

    fleet.push, fleet.surroundings, worst = push, Kept, 0.0
    for k, q, w in fleet.fly(np.tile(np.eye(4)[:, :1], (1, lanes)), np.zeros((3, lanes)), periods):
        assert np.linalg.norm(w, axis=0).max() <= n["end.rate"] or k < 3 * last
        worst = max(worst, float(turn(q).max()) / n["end.angle"]) if k >= 3 * last else worst
    return worst
