"""Places poles exactly by multi-level decomposition: u = -K x gives A - B K any spectrum, for any controllable A, B.

Level k is a pair A_k (n_k, n_k), B_k; the first is A, B. Its inputs act in r_k = rank B_k independent directions, the
columns of R_k: Bhat_k = B_k R_k has full column rank r_k. With P_k the annihilator of B_k (full row rank, P_k B_k = 0),

    A_{k+1} = P_k A_k P_k^+,    B_{k+1} = P_k A_k Bhat_k:

the directions reached by the inputs are the inputs of the rest. The last level has no rest. From there back up,

    G_k = Bhat_k^+ + K_{k+1} P_k (last: Bhat_k^+),    K_k = R_k (G_k A_k - Phi_k G_k),    K = K_0.

Why it is exact. G_k Bhat_k = E, so G_k (A_k - B_k K_k) = Phi_k G_k: the rows of G_k span a subspace with the spectrum of
Phi_k. On the kernel of G_k, where P_k is a coordinate, A_k - B_k K_k acts as P_k A_k (P_k^+ - Bhat_k K_{k+1}) =
A_{k+1} - B_{k+1} K_{k+1}. By induction the spectrum of A - B K is the union of those of all Phi_k.

Conditions. P_k^+ is the pseudo-inverse P'(P P')^-1, which is P' for orthonormal rows only: a right inverse S of P is valid
exactly if Bhat_k^+ S = 0. Another left inverse of Bhat_k with its S changes A_{k+1} by a multiple of B_{k+1}, and K_{k+1}
accordingly, but not G_k. So K depends only on Phi_k and R_k, and units of the states matter only for rounding: the levels
are computed for a balanced A, columns of B of similar size and orthonormal bases.

Complex poles shared by two levels. A level with one direction left over shares a pair p, p* with the level above: p in its
own Phi_k in direction e of Bhat_k, p* in direction R_k e of the level above. Then G_k is complex, but K is still real.

Source: the method of exact pole placement of Zubov, Mikrin, Misrikhanov and Ryabchenko (2012), as Zubov, Lapin and Mikrin
(2013) use it for attitude control in quaternions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from flint import acb, arb_mat

Array = NDArray[np.floating[Any]]
Complexes = NDArray[np.complexfloating[Any]]
Choice = Callable[[int, Array], Array | None] | Sequence[Array | None]

BITS = 512
"""Working precision in bits for the eigenvalues of the closed loop."""

NEAR = 1e-2
"""Poles with a relative difference below this are treated as a cluster."""

ALLOWED = 1e-6
"""The largest accepted relative error of the closed-loop poles."""

GIVEN = 1e-9
"""Relative tolerance for annihilators, and for the independence of directions."""


class UncontrollableError(ValueError):
    """No feedback moves the modes s (h,) of the pair: w A = s w and w B = 0 for the unit rows w of left (h, n)."""

    def __init__(self, modes: NDArray[Any], left: NDArray[Any]) -> None:
        self.modes, self.left = modes, left
        first, *_ = named = [_shown(mode) for mode in modes]
        super().__init__(
            f"the pair is not controllable: no input moves s = {', '.join(named)}; "
            f"rank [A - sE, B] < {left.shape[1]} for s = {first} along w = ({', '.join(_shown(entry) for entry in left[0])})"
        )


class Placement(NamedTuple):
    """A feedback u = -K x, K (m, n), and the intermediate results.

    spectra: Phi_k (r_k, r_k) of each level, the inputs' first, complex only where two levels share a pair of poles;
    directions: R_k; strength: the smallest singular value of each B_k over the norm of the balanced A (for the first, over
    its own largest), zero if the pair is not controllable; error: of the closed-loop poles, see `displacement`."""

    K: Array
    spectra: tuple[NDArray[Any], ...]
    directions: tuple[Array, ...]
    strength: tuple[float, ...]
    error: float


class _Level(NamedTuple):
    """A level in bases in which Bhat is `rows` transposed: a (size, size), rows (r, size), p (size - r, size).

    B = Bhat across and across right = E (r, r). The Bhat_k of the formulas is Bhat scale, up to a positive factor."""

    a: Array
    rows: Array
    p: Array
    across: Array
    right: Array
    scale: Array
    directions: Array
    strength: float


def levels(A: ArrayLike, B: ArrayLike) -> list[int]:
    """Return the number of poles of each level, the inputs' first, n in all. A: (n, n), B: (n, m). Errors as in `place`."""
    return [len(level.rows) for level in _decomposed(*_pair(A, B), None, None)[0]]


def is_stable(poles: ArrayLike) -> bool:
    """Return whether all poles have a negative real part."""
    return bool((np.real(poles) < 0.0).all())


def place(
    A: ArrayLike,
    B: ArrayLike,
    poles: ArrayLike | None = None,
    *,
    spectra: Sequence[ArrayLike] | None = None,
    annihilators: Choice | None = None,
    directions: Choice | None = None,
    allowed: float = ALLOWED,
) -> Placement:
    """Return the feedback K for which A - B K has these poles. A: (n, n), B: (n, m), real; poles in the unit of A.

    Either poles: (n,), real or in conjugate pairs, in any order and multiplicity. Slower poles go to levels farther from
    the inputs; pairs are real 2x2 blocks in one level, where possible, else shared by two. Or spectra: real Phi_k, (r_k,
    r_k) for the r_k of `levels`, in the coordinates of Bhat_k.

    annihilators: P_k of every level except the last; directions: R_k. A list, or a function of k and B_k (up to a positive
    factor). None, for all or for one, means the default: P_k orthonormal; R_k = E if B_k has full column rank, else an
    orthonormal basis of its row space, which is the pseudo-inverse of T_k in the skeleton B_k = Bhat_k T_k.

    Raise UncontrollableError, or ValueError for a wrong argument or an error of the closed-loop poles above `allowed`, as
    for nearly uncontrollable pairs, long chains from few inputs and poles of very different size."""
    a, b = _pair(A, B)
    if (poles is None) == (spectra is None):
        raise ValueError("give either poles or spectra")
    wanted = None if poles is None else _checked_poles(poles, len(a))
    with np.errstate(all="ignore"):
        chain, units, lengths = _decomposed(a, b, annihilators, directions)
        for name, choice in (("annihilators", annihilators), ("directions", directions)):
            if choice is not None and not callable(choice) and len(choice) > len(chain):
                raise ValueError(f"{name} has {len(choice)} entries, the pair has {len(chain)} levels")
        sizes = [len(level.rows) for level in chain]
        if wanted is not None:
            blocks = _blocks(_dealt(wanted, sizes), chain)
            kept = tuple(np.linalg.solve(level.scale, phi @ level.scale) for level, phi in zip(chain, blocks, strict=True))
        else:
            kept = _checked_spectra(() if spectra is None else spectra, sizes)
            blocks = [level.scale @ phi @ np.linalg.inv(level.scale) for level, phi in zip(chain, kept, strict=True)]
        k: NDArray[Any] = np.zeros((0, 0))
        for level, phi in zip(reversed(chain), reversed(blocks), strict=True):
            g = level.rows + k @ level.p if len(level.p) else level.rows
            k = level.right @ (g @ level.a - phi @ g)
        gain = np.real(k) / lengths[:, None] / units
    strength = tuple(level.strength for level in chain)
    weakest = int(np.argmin(strength))
    close = f"the weakest level, {weakest} of 0 to {len(chain) - 1}, has a relative strength of {strength[weakest]:.1e}"
    if not np.isfinite(gain).all():
        raise ValueError(f"the gains leave the range of floating-point numbers; {close}")
    error = _displacement(a, b, gain, _roots(kept) if wanted is None else wanted)
    if not error <= allowed:
        raise ValueError(f"the poles reached would be off by {error:.1e} of their size, {allowed:.1e} is allowed; {close}")
    return Placement(gain, kept, tuple(level.directions for level in chain), strength, error)


def reached(A: ArrayLike, B: ArrayLike, K: ArrayLike) -> Complexes:
    """Return the eigenvalues (n,) of A - B K for exactly these numbers, A (n, n), B (n, m), K (m, n), by their real part.

    Rounding of K alone spreads a pole of multiplicity k by about the k-th root of that rounding."""
    from flint import acb_mat, ctx

    with ctx.workprec(BITS // 4):
        modes = acb_mat(_closed(*_pair(A, B), np.asarray(K, float))).eig(algorithm="approx")
    return np.sort(np.array([complex(mode) for mode in modes]))


def displacement(A: ArrayLike, B: ArrayLike, K: ArrayLike, poles: ArrayLike) -> float:
    """Return the relative distance of eigenvalues of A - B K from poles (n,), to first order, without rounding except K's.

    For simple poles it is the largest distance over the pole's size. Poles closer than NEAR are not smooth functions of K,
    but the polynomial with these roots is: for k of them, about their mean, it is the change of its coefficient of degree k
    - j over the j-th power of their size (if that is zero, of the largest pole's, or else of A's).

    These changes a are the numerators of the partial fractions of (reached - wanted) / wanted, characteristic polynomials
    with exact coefficients. With n simple poles, each pole reached is within n |a| of a wanted one (Gershgorin)."""
    a, b = _pair(A, B)
    return _displacement(a, b, np.asarray(K, float), _checked_poles(poles, len(a)))


def _displacement(a: Array, b: Array, gain: Array, poles: Sequence[complex | acb]) -> float:
    from flint import acb, acb_mat, acb_poly, ctx

    largest = max(abs(complex(pole)) for pole in poles) or float(np.linalg.norm(a)) or 1.0
    with ctx.workprec(BITS):
        roots = [acb(pole) for pole in poles]
        change = acb_poly(_closed(a, b, gain).charpoly()) - acb_poly.from_roots(roots)
        columns: list[acb_poly] = []
        sizes: list[float] = []
        for near in _clusters([complex(root) for root in roots]):
            mean = sum((roots[i] for i in near), acb(0)) / len(near)
            size = max(abs(complex(roots[i])) for i in near) or largest
            part = acb_poly.from_roots([root for i, root in enumerate(roots) if i not in near])
            for power in range(len(near), 0, -1):
                columns.append(part)
                sizes.append(size**power)
                part = part * acb_poly([-mean, 1])
        rows = [[column[i] for column in columns] for i in range(len(roots))]
        try:
            parts = acb_mat(rows).solve(acb_mat([[change[i]] for i in range(len(roots))]), algorithm="approx")
        except ZeroDivisionError:
            return math.inf
        shares = [float(abs(part).mid() / size) for part, size in zip(parts.entries(), sizes, strict=True)]
    return max(shares) if all(math.isfinite(share) for share in shares) else math.inf


def _clusters(poles: list[complex]) -> list[list[int]]:
    """Return the indices of poles that are near one another, directly or through others between them."""
    clusters: list[list[int]] = []
    for i, pole in enumerate(poles):
        near = [old for old in clusters if any(abs(pole - poles[j]) <= NEAR * max(abs(pole), abs(poles[j])) for j in old)]
        clusters = [old for old in clusters if old not in near] + [[i, *(j for old in near for j in old)]]
    return clusters


def _closed(a: Array, b: Array, gain: Array) -> arb_mat:
    """Return A - B K in working precision."""
    from flint import arb_mat

    if gain.shape != b.T.shape or not np.isfinite(gain).all():
        raise ValueError(f"K must be finite and of shape {b.T.shape}, not {gain.shape}")
    return arb_mat(a.tolist()) - arb_mat(b.tolist()) * arb_mat(gain.tolist())


def _roots(spectra: Sequence[Array]) -> list[acb]:
    """Return eigenvalues of all the matrices, in working precision: in doubles those of Jordan blocks have few digits."""
    from flint import acb_mat, arb_mat, ctx

    with ctx.workprec(BITS):
        return [root for phi in spectra for root in acb_mat(arb_mat(phi.tolist())).eig(algorithm="approx")]


def _decomposed(
    a: Array, b: Array, annihilators: Choice | None, directions: Choice | None
) -> tuple[list[_Level], Array, Array]:
    """Return the levels, and the scales of the states (n,) and of the inputs (m,) in which they are expressed."""
    # By name, because the types of the library are too loose for a strict checker.
    library: Any = import_module("scipy.linalg")
    a, (units, _) = library.matrix_balance(a, permute=False, separate=True)
    b = b / units[:, None]
    lengths = np.abs(b).max(axis=0)
    lengths[lengths == 0.0] = 1.0
    size, noise = float(np.linalg.norm(a, 2)), 100.0 * len(a) * float(np.finfo(float).eps)

    # A function instead of a loop, whose variables take a type checker long.
    def below(at: int, a: Array, b: Array, scale: Array, down: Array, unit: Array, weakest: float) -> list[_Level]:
        u, s, v = np.linalg.svd(b)
        beside = float(size if at else s[0])
        # Weak inputs amplify the rounding of the states left to the next level.
        rank = int((s > noise / weakest * beside).sum())
        if rank == 0:
            modes, columns = np.linalg.eig(a.T)
            left: NDArray[Any] = columns.T @ down
            left /= np.linalg.norm(left, axis=1)[:, None]
            raise UncontrollableError(np.round(modes / (size or 1.0), 12) * size, np.round(left, 12))
        rows, across = u[:, :rank].T, s[:rank, None] * v[:rank]
        given, reply = unit[:, None] * (b @ scale), across @ scale
        turn = _chosen_directions(directions, at, given, reply)
        inner = reply @ turn
        right = scale @ turn @ np.linalg.inv(inner)
        # So that across right = E for any scales of the inputs.
        right += v[:rank].T / s[:rank] @ (np.eye(rank) - across @ right)
        p = _chosen_annihilator(annihilators, at, given, unit, rows, u[:, rank:].T)
        strength = float(s[rank - 1]) / beside
        level = _Level(a, rows, p, across, right, inner, turn, strength)
        if not len(p):
            return [level]
        # Orthonormal rows are their own pseudo-inverse, without rounding.
        back = p.T if annihilators is None else np.linalg.pinv(p)
        onward, reached = p @ a @ back, p @ a @ rows.T
        scale = inner / np.abs(inner).max()
        return [level, *below(at + 1, onward, reached, scale, p @ down, np.ones(len(onward)), min(weakest, strength))]

    return below(0, a, b / lengths, np.diag(lengths), np.diag(1.0 / units), units, 1.0), units, lengths


def _chosen(name: str, choice: Choice | None, at: int, given: Array, shape: tuple[int, int]) -> Array | None:
    """Return the user's choice for a level whose B is `given`, or None."""
    chosen = choice(at, given) if callable(choice) else choice[at] if choice is not None and at < len(choice) else None
    if chosen is not None and _real(f"{name} of level {at}", chosen).shape != shape:
        raise ValueError(f"{name} of level {at} must have shape {shape}, not {np.shape(chosen)}")
    return None if chosen is None else np.asarray(chosen, dtype=float)


def _chosen_directions(choice: Choice | None, at: int, given: Array, reply: Array) -> Array:
    """Return R (m, r) of a level whose B is `given` (n, m), an orthonormal basis times `reply` (r, m)."""
    rank, inputs = reply.shape
    turn = _chosen("directions", choice, at, given, (inputs, rank))
    if turn is None:
        return np.eye(inputs) if rank == inputs else np.linalg.qr(reply.T)[0]
    s = np.linalg.svd(reply @ turn, compute_uv=False)
    if not s[-1] > GIVEN * s[0]:
        raise ValueError(f"directions of level {at} leave out some of what its inputs reach")
    return turn


def _chosen_annihilator(choice: Choice | None, at: int, given: Array, unit: Array, rows: Array, usual: Array) -> Array:
    """Return P (rest, n) of a level, in units (n,), whose B, `given`, spans the orthonormal `rows` (r, n) and leaves
    `usual`."""
    p = _chosen("annihilators", choice, at, given, usual.shape) if len(usual) else None
    if p is None:
        return usual
    p = p * unit
    s = np.linalg.svd(p, compute_uv=False)
    if not s[-1] > GIVEN * s[0]:
        raise ValueError(f"annihilators of level {at} lack full row rank")
    over = p @ rows.T
    if not np.linalg.norm(over, 2) <= GIVEN * s[-1]:
        raise ValueError(f"annihilators of level {at} do not annihilate its inputs: P B is not zero")
    return (p - over @ rows) / s[0]


def _dealt(poles: list[complex], sizes: list[int]) -> list[list[complex]]:
    """Return the poles of each level, the inputs' first: p, p* side by side, but a shared pair split into the last pole of
    the level below and the first of the level above. Real poles are kept for levels with an odd number of poles."""
    slow = sorted(poles, key=lambda pole: (abs(pole), pole.real, pole.imag))
    reals, pairs = ([p for p in slow if p.imag == 0.0], [p for p in slow if p.imag > 0.0])
    dealt: list[list[complex]] = []
    shared: list[complex] = []
    for at in reversed(range(len(sizes))):
        level, shared = shared, []
        while free := sizes[at] - len(level):
            spare = len(reals) > sum(size % 2 for size in sizes[:at]) + free % 2
            if free > 1 and pairs and not (spare and abs(reals[0]) < abs(pairs[0])):
                level += [pairs[0], pairs.pop(0).conjugate()]
            elif reals:
                level.append(reals.pop(0))
            else:
                level.append(pairs[0])
                shared = [pairs.pop(0).conjugate()]
        dealt.append(level)
    return dealt[::-1]


def _blocks(dealt: list[list[complex]], chain: list[_Level]) -> list[NDArray[Any]]:
    """Return a matrix with the poles of each level, real except for shared pairs."""
    blocks: list[NDArray[Any]] = []
    along: tuple[Array, Array] | None = None
    for poles, level in zip(reversed(dealt), reversed(chain), strict=True):
        basis, normal = np.eye(len(poles)), np.diag(poles)
        if along is not None:
            # The shared pole in the direction shared with the level below, the others in the null space of the coupling.
            basis = np.column_stack([along[0], np.linalg.svd(along[1][None])[2][1:].T])
        for i, pole in enumerate(poles[:-1]):
            if pole.imag > 0.0:
                normal[i : i + 2, i : i + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        inverse = np.linalg.inv(basis)
        phi = basis @ normal @ inverse
        blocks.append(phi if phi.imag.any() else phi.real)
        along = (level.right @ basis[:, -1], inverse[-1] @ level.across) if np.imag(normal[-1, -1]) > 0.0 else None
    return blocks[::-1]


def _pair(A: ArrayLike, B: ArrayLike) -> tuple[Array, Array]:
    a, b = _real("A", A), _real("B", B)
    if a.ndim != 2 or a.shape[0] != a.shape[1] or a.size == 0:
        raise ValueError(f"A must be square, not of shape {a.shape}")
    if b.ndim != 2 or len(b) != len(a) or b.size == 0:
        raise ValueError(f"B must have {len(a)} rows and at least one column, not shape {b.shape}")
    return a, b


def _real(name: str, value: ArrayLike) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "biuf" or not np.isfinite(array).all():
        raise ValueError(f"{name} must be of finite real numbers")
    return array.astype(float)


def _checked_poles(poles: ArrayLike, size: int) -> list[complex]:
    given = np.asarray(poles)
    if given.shape != (size,):
        raise ValueError(f"poles must be {size} numbers, one for each state, not of shape {given.shape}")
    if given.dtype.kind not in "biufc" or not np.isfinite(given).all():
        raise ValueError("poles must be finite numbers")
    numbers = [complex(pole) for pole in given]
    lone = Counter(numbers) - Counter(pole.conjugate() for pole in numbers)
    if lone:
        raise ValueError(f"poles must be real or in conjugate pairs: {_shown(next(iter(lone)))} lacks its conjugate")
    return numbers


def _checked_spectra(spectra: Sequence[ArrayLike], sizes: list[int]) -> tuple[Array, ...]:
    matrices = tuple(_real("spectra", phi) for phi in spectra)
    if (shapes := [phi.shape for phi in matrices]) != [(size, size) for size in sizes]:
        raise ValueError(f"spectra must be square matrices of sizes {sizes}, not of shapes {shapes}")
    return matrices


def _shown(number: complex) -> str:
    return f"{number.real + 0.0:.4g}" if number.imag == 0.0 else f"{number:.4g}"
