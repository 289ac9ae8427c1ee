"""The best moves of plans in floats, for many states at once: another reading of a claim about them, which shares no code
with the kernel and none with the law."""

import math

import numpy as np
from scipy.linalg import expm


def skew(v):
    """The matrices of v x, of columns (3, lanes)."""
    zero = np.zeros(v.shape[1])
    return np.array([[zero, -v[2], v[1]], [v[2], zero, -v[0]], [-v[1], v[0], zero]]).transpose(2, 0, 1)


class Planned:
    """What a claim tells of the plan of its law."""

    def __init__(self, subject, numbers, J):
        self.J, self.inverse, self.h, self.N = J, np.linalg.inv(J), numbers["period"], int(subject["plan.moves"])
        self.Q = np.diag([subject[f"plan.state.{k}"] for k in range(6)])
        self.R = np.diag([subject[f"plan.command.{k}"] for k in range(3)])
        self.P = np.array([[subject[f"plan.end.{min(i, k)}.{max(i, k)}"] for k in range(6)] for i in range(6)])
        self.axis, self.norm = (subject.get(f"plan.{name}", math.inf) for name in ("limit", "limit.norm"))
        self.error = numbers["plan.error"]
        moments = np.linalg.eigvalsh(J)
        self.strength = numbers["plan.stiffness"] / max(moments[-1] - moments[0], 1e-12 * moments[-1])

    def motion(self, w, n):
        """A (lanes, 6, 6) and B (lanes, 6, 3) of (w, q) about rates, with gravity along n, both (3, lanes)."""
        spin, lanes = skew(w), w.shape[1]
        pull = self.strength * (skew(n) @ self.J @ skew(n) - skew(self.J @ n) @ skew(n))
        M = np.zeros((lanes, 9, 9))
        M[:, :3, :3], M[:, :3, 3:6] = self.inverse @ (skew(self.J @ w) - spin @ self.J), self.inverse @ pull
        M[:, :3, 6:], M[:, 3:6, :3], M[:, 3:6, 3:6] = self.inverse, 0.5 * np.eye(3), -spin
        total = expm(self.h * M)
        return total[:, :6, :6], total[:, :6, 6:]

    def moves(self, w, n):
        """The best moves without limits, as factors of (w, q): (moves, lanes, 3, 6)."""
        A, B = self.motion(w, n)
        onward, gains = self.P, []
        for _ in range(self.N):
            pushed = B.transpose(0, 2, 1) @ onward
            gains.append(np.linalg.solve(self.R + pushed @ B, pushed @ A))
            onward = self.Q + A.transpose(0, 2, 1) @ onward @ (A - B @ gains[-1])
            onward = 0.5 * (onward + onward.transpose(0, 2, 1))
        state, moves = np.broadcast_to(np.eye(6), A.shape), []
        for gain in reversed(gains):
            moves.append(-gain @ state)
            state = A @ state + B @ moves[-1]
        return np.array(moves)

    def torques(self, q, w, n, ahead):
        """The torques (moves, 3, lanes) of the best plan, with what follows the target, (3, lanes)."""
        return np.einsum("klij,jl->kil", self.moves(w, n), np.concatenate([w, q[1:]])) + ahead

    def exceeded(self, torques):
        """How much more than its limit a plan asks for, as a share: not above 1 where it keeps it."""
        axis, size = np.abs(torques).max() / self.axis, np.linalg.norm(torques, axis=1).max() / self.norm
        return max(axis, size)

    def holds(self, program, q, w, rng):
        """Whether the best plans keep their limits, and are as near the torque of a program as is claimed."""
        if not (min(np.diag(self.Q)) >= 0.0 and min(np.diag(self.R)) > 0.0 and np.linalg.eigvalsh(self.P)[0] > -1e-9):
            return False
        n = rng.normal(size=w.shape)
        torques = self.torques(q, w, n / np.linalg.norm(n, axis=0), 0.0)
        off = np.linalg.norm(torques[0] - program, axis=0)
        return self.exceeded(torques) <= 1.0 + 1e-9 and bool((off <= self.error).all())
