"""The theorem about the loop that flies with appendages, near its target: the torque is held between samples, external
torques and errors are bounded, and the motion of body and appendages is a program. Proof: docs/kernel.md, section 12."""

from __future__ import annotations

from fractions import Fraction

from ..appended import Appended, Box, Column, Period, after, combined, follow, image
from ..loops import AttitudeLoop, wired
from ..near import form_of
from ..numbers import Rows, added, definite, demand, inverse, matrix, norm, rational, reach, read_list, read_table, scalar
from ..polynomials import minus, most, var
from ..reading import Claim
from ..regions import STATE
from ..rules import Exceeds, Part, Proof, vanish
from ..sentences import Statement, above, below, enumerated
from .attitude import contents
from .pointing import HALF_TURN, bounded_motion
from .response import PARTS, Response, summed

KINDS = (0, 1), (2,), (3,)
ROUNDS, FOLLOWED = 32, 1024
"""The most rounds, and the most periods of one that are followed one by one."""


def points_with_appendages(claim: Claim) -> Proof:
    """Every motion from {V <= level}, with states of the appendages of at most begun.k, has V <= highest at all times; after
    the time `settling` its rotation is at all times at most end.angle and its rate at most end.rate. The torque is the law's
    command at the last sample plus an error, |error| <= error, within its limits where these are stated; errors of the
    measured attitude and rate are at most error.attitude and error.rate; external torques are at most `outside`. `error` and
    `outside` may grow by `.per.rate` times the body's rate.

    Evidence: modal coordinates, in blocks of one or two, and rounds of bounds: at samples (radii), of the states and the
    torque between samples, and the number of periods until the next round; the last one has no end. In its box the response
    of the linear motion may be summed.
    """
    loop, numbers = AttitudeLoop(claim), claim.numbers
    yield from vanish("turning", minus(loop.single("turning", 4, wired("q", loop.q), wired("rate", loop.w)), loop.turning))
    motion = Appended(loop)
    ellipsoid = inner(loop, numbers["level"])
    turns = [numbers.get(name) or Fraction(0) for name in ("angle", "start.angle")]
    demand(max(turns) <= HALF_TURN, "a start is not near the target")
    start = yield from contents(loop, loop.lyapunov)
    blocks = read_list(claim.evidence["blocks"])
    demand(all(type(size) is int for size in blocks), "a size of a block is no whole number")
    motion.take(matrix(claim.evidence["modes"], motion.n, motion.n), blocks)
    limits = [numbers.get(name) for name in ("limit", "limit.norm")]
    begun_with = [numbers[f"begun.{k}"] for k in range(motion.count)]
    begun, samples, V = motion.begun(ellipsoid, begun_with), 0, loop.lyapunov.at({"q0": 1 - var("v")})
    times, turned, ends = list[Fraction](), list[Fraction](), list[tuple[Period, Box, Column]]()
    rounds = read_list(claim.evidence["rounds"])
    demand(0 < len(rounds) <= ROUNDS, "there is no round, or too many are")
    for k, one in enumerate(rounds):
        sizes, torques, sought, periods = read_table(one, "sizes", "torques", "radii", "periods")
        demand(type(periods) is int and (periods > 0) == (k < len(rounds) - 1), "a round has no proper length")
        state, torque, radii = positive(sizes, motion.n), positive(torques, 3), positive(sought, len(blocks))
        box = Box(state, torque, combined(state, motion.misread))
        period = motion.period(box)
        times.append(motion.h * samples)
        turned.append(norm(state[3:6]))
        if 0 < periods <= FOLLOWED:
            largest, later = follow(period, begun, periods)
        else:
            # What motions do not leave in one period they never leave.
            largest = [max(x, y) for x, y in zip(begun, combined(image(period.grown, radii), period.more), strict=True)]
            later = [min(x, r) for x, r in zip(after(period, begun, periods), radii, strict=True)]
        felt = image(period.torque, radii)
        commanded = combined(felt, period.commanded)
        yield from exceed(f"samples {k}", radii, largest)
        yield from exceed(f"between samples {k}", state, combined(image(period.between, radii), period.far))
        yield from exceed(f"held torque {k}", torque, combined(felt, period.pushed))
        yield f"highest V {k}", Exceeds(numbers["highest"], most(V, sized(state)))
        for name, limit, size in zip(
            ("limit", "norm of the torque"), limits, (max(commanded), norm(commanded)), strict=True
        ):
            if limit is not None:
                yield f"{name} {k}", Exceeds(limit, size)
        ends.append((period, box, radii))
        begun, samples = later, samples + periods
    wide, most_turned = norm(ends[-1][1].state[:3]), norm(ends[-1][1].state[3:6])
    if (sums := claim.evidence.get("response")) is not None:
        response = yield from responds(motion, *read_table(sums, "weights", "gains"))
        wide, most_turned = settled(motion, response, *ends[-1])
        samples += response.count
        times.append(motion.h * samples)
        turned.append(most_turned)
    angle, fastest = numbers["end.angle"], numbers["end.rate"]
    # sin x >= x - x^3/6.
    yield "end of the angle", Exceeds(angle / 2 - angle**3 / 48, most_turned)
    yield "end of the rate", Exceeds(fastest, wide)
    yield "settling", Exceeds(numbers["settling"], motion.h * samples)

    kinds = [("attitude that it is told", "error.attitude", "rad"), ("rate", "error.rate", "rad/s")]
    misread = [(text, numbers.get(name) or Fraction(0), unit) for text, name, unit in kinds]
    more = f" with states of the appendages of up to {', '.join(map(below, begun_with))}"
    text = bounded_motion(numbers, f"V <= {below(numbers['level'])}, q0 > 0", more, misread)
    for limit, where in zip(limits, ("about any axis", "in norm"), strict=True):
        text += "" if limit is None else f", and the law asks for no more than {above(limit)} N m {where}"
    unlimited = ["unlimited-torque"] * (limits == [None, None])
    assumed = ["appendages-as-given", "bounded-push", "held-torque", *unlimited, *loop.untold]
    assumed += ["target-at-rest", "no-wheels"]
    said = f"; {enumerated(start)}" if start else ""
    # From the start of a round on, rotations are within the bounds of that round and of later ones.
    within = [(time, max(turned[k:])) for k, time in enumerate(times)]
    return Statement(text + said, (*assumed, loop.sign_assumed), "appendages", within=tuple(within))


def responds(motion: Appended, weights: object, gains: object) -> Part[Response]:
    """The gains are at least those of the linear motion of body and appendages, for rates, turns and linear acceleration:
    from external torques that vary freely within a period, and from torque errors that are held over it."""
    return summed(scalar(1, motion.n)[:6] + motion.pull, PARTS, motion.sampled, motion.ways, KINDS, weights, gains, True)


def settled(motion: Appended, response: Response, period: Period, box: Box, radii: Column) -> tuple[Fraction, Fraction]:
    """Return bounds of |w| and |q| at all times, once so many samples have stayed in a box."""
    wrong = period.error + norm(combined(image(period.law, radii), period.law_rest))
    rest, pushes = motion.beside(period, box, wrong), (period.outside, period.outside, wrong)
    wide, turned, pulled = (
        added([gain * b for gain, b in zip(gains, pushes, strict=True)])
        + norm(combined(reach(response.beside[part], rest), reach(response.left[part], box.state)))
        for gains, part in zip(response.gains, PARTS.values(), strict=True)
    )
    # Each time is at most h/2 from a sample, and |q''| <= |w'|/2 + |w|^2 |q|/4.
    h, hurried = motion.h, pulled + motion.hurried(period, box, radii, wrong)
    bent = hurried + norm(box.state[:3]) ** 2 * norm(box.state[3:6]) / 2
    return wide + h / 2 * hurried, turned + h * h / 16 * bent


def inner(loop: AttitudeLoop, level: Fraction) -> Rows:
    """Return the matrix of an ellipsoid of (w, q) that contains {V <= level} where q0 > 0, for V = s (1 - q0) + x.Gx. There
    2 (1 - q0) >= |q|^2."""
    s, G = form_of(loop)
    demand(s >= 0 and definite(G, strictly=False), "V is not least on target")
    under = [[entry + s / 2 * (i == k > 2) for k, entry in enumerate(row)] for i, row in enumerate(G)]
    demand(definite(under), "V is not least on target")
    return [[level * x for x in row] for row in inverse(under)]


def positive(given: object, count: int) -> Column:
    """Read so many positive numbers."""
    column = [rational(x) for x in read_list(given, count)]
    demand(all(x > 0 for x in column), "a bound is not positive")
    return column


def exceed(name: str, large: Column, small: Column) -> Part[None]:
    """Each entry of one column exceeds that of another; they are numbered."""
    for k, (x, y) in enumerate(zip(large, small, strict=True)):
        yield f"{name} {k}", Exceeds(x, y)


def sized(state: Column) -> dict[str, Fraction]:
    """Return sizes by the names of the state, and of v = 1 - q0 <= |q|^2, as q0 > 0."""
    turned = sum((x * x for x in state[3:6]), Fraction(0))
    return dict(zip(STATE, state[:6], strict=True)) | {"v": turned}
