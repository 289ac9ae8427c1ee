"""The theorem about the loop that flies: the torque is held between samples, external torques and errors of the command are
bounded, and motions from a large set come as near to the target as stated. Proof: docs/kernel.md, section 10."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from math import ceil

from ..follower import FIRST, REST, WITHIN
from ..held import Held
from ..loops import AttitudeLoop
from ..numbers import (
    RefusedError,
    Rows,
    demand,
    matrix,
    norm,
    plus,
    rational,
    read_list,
    read_table,
    root,
    scalar,
    times,
    transpose,
    up,
)  # fmt: skip
from ..reading import Claim, Numbers
from ..regions import AMISS, ANGLE, AT_REST, RATE, TURN, Tube, as_told, balls
from ..rules import Definite, Exceeds, Proof
from ..sentences import Statement, above, below, enumerated
from .attitude import contents
from .kinetic import KINETIC, asking, commanded, stays_slow
from .limits import within_limits
from .noise import DEVIATION, SHARE, within_radii
from .response import first_of, responds

ROUNDS = 64
"""How often responses may be taken, each in the set that the one before leads to."""

NEARLY = Fraction(9, 8)
"""The late torque's error counts as settled within this factor of its limit."""
SLIGHT = 1 << 14
"""The error of a late torque near the target, relative to what is left there of that in larger sets once this is
forgotten."""

HALF_TURN = Fraction(314, 100)
"""Just below a half turn (rad)."""


def points(claim: Claim) -> Proof:
    """Every motion from {V <= level} has V <= highest at all times; after the time `settling` its rotation is at all times
    at most end.angle and its rate at most end.rate. The torque is the law's command at the last sample plus an error,
    |error| <= error. Errors of the law's inputs are at most error.attitude and error.rate, and for the target's rate and
    acceleration error.target.rate and error.target.acceleration; external torques that the law does not know are at most
    `outside`. `error` and `outside` may grow by `.per.rate` times the body's rate.

    The external torque that the law knows may reverse at once; with told.change it is the one at the measured attitude, and
    changes no faster than that plus told.change.per.rate times the body's rate. With a `share` all of this is true at so
    many `samples` on end except with this probability: errors that noise drives add at most noise.attitude and noise.rate.
    The law may keep a memory, whatever it contains, that adds a torque of at most `memory` about each axis. With a
    `tolerance` the inertia is any one near the given one. The law may command the first move of a plan, see `plans`.
    """
    loop = AttitudeLoop(claim, remembers=True)
    yield from loop.sound()
    return (yield from descends(loop, Held(loop)))


def descends(loop: AttitudeLoop, motion: Held) -> Proof:
    """The theorem `points` for a loop whose body is the one of the equations."""
    claim, numbers, samples = loop.claim, loop.claim.numbers, 0
    c, h, motion.kinetic, motion.commands = numbers["level"], motion.h, numbers.get(KINETIC), commanded(motion, numbers)
    starts = [numbers.get(name) or Fraction(0) for name in ("angle", "start.angle")]
    demand(not motion.even or max(starts) <= HALF_TURN, "V is the same at the other quaternion")
    # The late torque's error is in the set from the beginning.
    behind = motion.late.weight * motion.late.begun**2 if motion.late else Fraction(0)
    demand(behind < c or not behind, "what is late in the beginning is beyond the level")
    start = yield from contents(loop, loop.lyapunov + behind)
    tube = motion.tube(motion.region(c))
    region = tube.region
    planned, torques = "", None
    if motion.plan is not None:
        wrong = motion.wrong(region.sizes)
        planned, torques = yield from motion.plan.keeps(region, (wrong["w"], wrong["q"]), as_told(region.sizes, wrong))
    off = motion.misread(region)[0] + motion.planned(region.sizes)
    behind_at_most = motion.behind(region.sizes).most
    if WITHIN in numbers or not motion.inexact:
        # Its components change one by one, not towards the command.
        off += behind_at_most
    if WITHIN in numbers:
        yield "torque that follows", Exceeds(numbers[WITHIN], behind_at_most)
    # Wheels take up what is asked for evenly, but for friction and for what is late, each no more than its bound.
    pushed = motion.pushed(tube.sizes)
    between = h / 2 * (pushed["both"] - pushed["outside"] - motion.planned(tube.sizes) + behind_at_most)
    slow, limiting = (yield from stays_slow(motion, tube)), asking(motion, tube)
    limited = yield from within_limits(loop, off + norm([loop.added or Fraction(0)] * 3), torques, between, slow, limiting)
    if loop.signs:
        yield "the sign never changes", Exceeds(region.least, motion.misled(region.sizes)[0] / 2)
    if motion.late and (change := motion.change_in(tube)):
        yield "late torque", Exceeds(motion.late.rest, change.settled)
    yield "V between samples", Exceeds(numbers["highest"], c + h / 2 * motion.swing(tube))
    noise = Statement("", ())
    demand(motion.random == 0 or (SHARE in numbers and DEVIATION in numbers), "a random torque has no share")
    if SHARE in numbers:
        noise = yield from within_radii(claim, motion)
    levels, ellipsoids = (read_list(claim.evidence[name]) for name in ("levels", "ellipsoids"))
    demand(bool(levels), "no level is stated")
    within = [(Fraction(0), tube.sizes[ANGLE])]
    for k, one in enumerate(levels):
        end, tau, beta = map(rational, read_table(one, "end", "tau", "beta"))
        Q, H, F, push, rest, spare = motion.fall(tube)
        demand(tau > 0 and 0 < h * beta <= spare and 0 < end < c, "a level is not properly stated")
        pushed = push * push / (4 * tau) + rest
        fallen = plus(plus(Q, times(transpose(F), F), -tau), H, -beta)
        yield f"V decreases by a share {k}", Definite(fallen)
        yield f"level {k}", Exceeds(end, pushed / beta)
        samples += periods(h * beta, pushed / beta, c, end) if end > pushed / beta else 0
        c, (tube, more) = end, on_level(motion, end, tube)
        samples += more
        within.append((h * samples, tube.sizes[ANGLE]))
    last, beside, corners = tube.region.X, AT_REST, motion.corners()
    away = motion.away
    motion.nears(tube)
    entered = motion.entered(tube)
    for k, one in enumerate(ellipsoids):
        tube, more = forgotten(motion, tube)
        samples += more
        shape, parts, *rest = read_table(one, "shape", "shares", "rate", "reach")
        X, shares, (rate, reach) = (
            matrix(shape, len(entered), len(entered)),
            [rational(x) for x in read_list(parts, 3)],
            map(rational, rest),
        )
        free = 1 - sum(shares, Fraction(0))
        demand(min(free, rate, reach, *shares) > 0 and rate < 1, "an ellipsoid is not properly stated")
        left = plus([[rate * x for x in row] for row in X], spread(shares, motion.linear(tube)), -1)
        for corner, A in enumerate(corners):
            yield f"ellipsoid {k} {corner}", Definite(plus(left, times(A, times(X, transpose(A))), Fraction(-1) / free))
        yield f"entry {k}", Definite(plus([[reach * x for x in row] for row in X], entered, -1))
        fall = 1 - rate * free
        samples += periods(fall, rate * (1 - free) / fall, reach, Fraction(1))
        before, tube, last, entered, beside = tube, motion.tube(tube.region.within(X, away)), X, X, away
        samples += waited(motion, before, tube)
        within.append((h * samples, tube.sizes[ANGLE]))
    if (summed := claim.evidence.get("response")) is not None:
        rounds, weights, gains = read_table(summed, "rounds", "weights", "gains")
        demand(type(rounds) is int and 0 < rounds <= ROUNDS, "a response is taken too often")
        response = yield from responds(motion, weights, gains)
        radii, pulled = first_of(motion, tube)
        for _ in range(rounds):
            tube, more = forgotten(motion, tube)
            samples += more
            before, (radii, pulled, tube) = tube, response.after(motion, tube, radii, pulled)
            samples += response.count + waited(motion, before, tube)
            within.append((h * samples, tube.sizes[ANGLE]))
            last, beside = balls(radii), away
    angle, fastest = numbers["end.angle"], numbers["end.rate"]
    # Both samples next to a time lie in the region, and sin x >= x - x^3/6.
    near = angle / 2 - angle**3 / 48 - motion.bend_between(tube) - beside[1]
    slow = fastest - norm(tube.drift) / 2 - beside[0]
    for name, most_of, part in (("angle", near, TURN), ("rate", slow, RATE)):
        demand(most_of > 0, f"the {name} is too small")
        yield f"end of the {name}", Definite(plus(scalar(most_of * most_of), [row[part] for row in last[part]], -1))
    yield "settling", Exceeds(numbers["settling"], h * samples)

    misread = [("attitude that it is told", motion.turned, "rad"), ("rate", motion.rated, "rad/s")]
    misread += [("target's rate", motion.led, "rad/s"), ("target's acceleration", motion.hurried, "rad/s2")]
    begun = "V <= " + below(numbers["level"] - behind) + ", q0 > 0" * motion.even
    begun += f", w.Jw <= {below(motion.kinetic)}" if motion.kinetic is not None else ""
    alone = f"the state{' and momentum' * loop.wheels} alone"
    begun += f", at most {below(limiting.share)} of the limits asked for by the law for {alone}" if limiting else ""
    text = bounded_motion(numbers, begun, "", misread)
    text += with_motion(motion)
    text += f", the torque that acts late, {motion.late.in_words}" if motion.late else ""
    text += motion.alike_in_words
    text += f", at no time by {above(numbers[WITHIN])} N m" if WITHIN in numbers else ""
    text += "" if loop.added is None else f", a memory that adds up to {below(loop.added)} N m about each axis"
    text += f", with every J_ik off by up to {below(numbers['tolerance'])} sqrt(J_ii J_kk)" if motion.off else ""
    text += f", {planned}" * bool(planned)
    text += "".join(f", {name} of up to {below(x)}" for name, x in motion.bounded.items()) + noise.text
    text += ", momentum being that with the inertia as given" * bool(motion.off and loop.wheels)
    assumed = [
        "rigid-body",
        "inertia-near" if motion.off else "inertia-as-given",
        "bounded-push",
        "held-torque",
        *noise.assumptions,
        *limited.assumptions,
    ]
    assumed += ["best-plan"] * bool(planned) + ["late-torque"] * bool(motion.late)
    assumed += ["late-alike"] * bool(motion.inexact) + ["late-told"] * motion.grows
    assumed += loop.untold + ["bounded-outside-torque"] * loop.outside + ["changing-outside-torque"] * bool(motion.change)
    assumed += ["bounded-target" if loop.moving else "target-at-rest"]
    assumed += ["bounded-momentum" if loop.wheels else "no-wheels", loop.sign_assumed]
    # A torque that lags is between what is asked for and what acts at first.
    within_too = ", if the torque that acts at first is within that too" * bool(motion.inexact and WITHIN not in numbers)
    said = "".join(f"; {part}" for part in (enumerated(start), limited.text and limited.text + within_too) if part)
    return Statement(text + said, tuple(dict.fromkeys(assumed)), "pointing", within=tuple(within))


def with_motion(motion: Held) -> str:
    """Return what a claim says about measurement errors that grow with the motion."""
    text, of = "", (("rad/s", "rate"), ("rad/s2", "acceleration"))
    for name, unit, sizes in zip(("attitude", "rate"), ("rad", "rad/s"), motion.moving, strict=True):
        grown = zip(sizes, of, strict=True)
        more = [f"{below(x)} {unit} for each {per} of the body's {which}" for x, (per, which) in grown if x]
        text += f", errors of the told {name} of up to {' and '.join(more)} more" if more else ""
    kept = f", and {below(motion.held_back)} times what was more before that" if motion.held_back else ""
    return text and f"{text}, which are those of the last {below(motion.ago)} s{kept}"


def bounded_motion(numbers: Numbers, begun: str, more: str, misread: Sequence[tuple[str, Fraction, str]]) -> str:
    """Return what a claim says about motions from a set while the torque is held. misread: for each input of the law its
    name, the largest error, and its unit."""

    def most(name: str) -> str:
        growing = numbers.get(f"{name}.per.rate")
        return f"of up to {below(numbers[name])} N m" + (
            f" and {below(growing)} N m s times the rate of the body" if growing else ""
        )

    errors = [f"errors of the command {most('error')}"]
    errors += [f"of the {name} of up to {below(x)} {unit}" for name, x, unit in misread if x]
    return (
        f"every motion from {{{begun}}}{more} stays in {{V <= {above(numbers['highest'])}}}, and after"
        f" {above(numbers['settling'])} s it is at all times within {above(numbers['end.angle'])} rad of the target and"
        f" turns no faster than {above(numbers['end.rate'])} rad/s, with the torque held for {below(numbers['period'])} s,"
        f" torques from outside {most('outside')} and {enumerated(errors)}"
    )


def spread(shares: Sequence[Fraction], pushes: Sequence[tuple[Rows, Fraction]]) -> Rows:
    """Return what the sum of B v, |v| <= b, adds to AXA' / (1 - the sum of shares), so that the ellipsoid of the result,
    x.X^-1 x <= 1, contains Ax + that sum."""
    grown = scalar(0, len(pushes[0][0]))
    for (B, b), share in zip(pushes, shares, strict=True):
        grown = plus(grown, times(B, transpose(B)), b * b / share)
    return grown


def on_level(motion: Held, c: Fraction, before: Tube | None = None) -> tuple[Tube, int]:
    """Return the tube of a level once the late torque's earlier error is forgotten, and the number of periods until then.
    before: the tube in which motions came there."""
    tube = motion.tube(motion.region(c))
    samples = waited(motion, before, tube) if before else 0
    if motion.late:
        tube, more = forgotten(motion, tube, False)
        samples += more
    return tube, samples


def forgotten(motion: Held, tube: Tube, near: bool = True) -> tuple[Tube, int]:
    """Return the tube once the late torque's error in larger sets, or its part b, is forgotten, and the number of periods
    until then."""
    if (late := motion.late) is None:
        return tube, 0
    sizes = tube.region.sizes
    if near:
        linear, rest = motion.lateness(tube)
        left = (linear + rest) / SLIGHT
        samples = periods(1 - late.kept, Fraction(0), sizes[FIRST] + sizes[REST] + motion.unsettled, left)
        late_by = {FIRST: linear, REST: rest + left}
    else:
        change = motion.change_in(tube)
        assert change is not None
        begun, end = sizes[REST], NEARLY * change.settled
        samples = periods(1 - change.kept, change.settled, begun, end)
        late_by = {REST: min(begun, end)}
    after = motion.tube(replace(tube.region, sizes=sizes | late_by))
    return after, samples + waited(motion, tube, after)


def waited(motion: Held, before: Tube, after: Tube) -> int:
    """Return the number of periods in the region of a tube until measurement errors are within their bounds there, while the
    effect of the motion in the tube before is forgotten."""
    if not motion.grows:
        return 0
    amiss, end = ([tube.region.sizes[x] for x in AMISS] for tube in (before, after))
    for k in range(ROUNDS):
        if all(x <= y for x, y in zip(amiss, end, strict=True)):
            return k * max(1, ceil(motion.ago / motion.h))
        tube = motion.tube(after.region, amiss)
        less = motion.misleading(tube)
        amiss = [min(x, up(y + motion.held_back * (x - y))) for x, y in zip(amiss, less, strict=True)]
    raise RefusedError("errors are not forgotten")


def periods(fall: Fraction, floor: Fraction, start: Fraction, end: Fraction) -> int:
    """Return the number of periods until x is below `end`, where each makes it at most (1 - fall) x + fall floor: (1 -
    fall)^n <= (1 + fall n / 64)^-64."""
    if start <= end:
        return 0
    ratio = up((start - floor) / (end - floor))
    for _ in range(6):
        ratio = root(ratio)
    return -((64 * (1 - ratio)) // fall)
