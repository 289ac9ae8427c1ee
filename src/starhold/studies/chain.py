"""The chain of a mission's modes: whether the claim about each mode as it flies covers all states in which the previous mode
ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from starhold.certification.certify import Wanted, certify
from starhold.certification.hand_over import flown_ends, misjudged
from starhold.certification.matrices import above
from starhold.certification.subject import make_subject
from starhold.certification.wording import listed
from starhold.laws.modes import names_of_modes
from starhold.studies.body import Issued
from starhold.studies.modes import RELEASED, STORED, HandOver, fresh_momentum, hand_overs, left_momentum

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate, Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario


class Link(NamedTuple):
    """A switch to the next mode, with the modes' names. rate, angle, momentum: bounds on the state in which the next mode
    begins (rad/s, rad, both relative to its target, N m s), inf for none; claim: the claim about the next mode as it flies,
    if any; assumed: its further assumptions; lacks: the reasons why it does not cover these states; heavy: whether only the
    momentum is too large for it; wide: whether it is the claim made for this momentum; name: that of the switch."""

    before: str
    after: str
    rate: float
    angle: float
    momentum: float
    claim: Claim | None
    assumed: tuple[str, ...]
    lacks: tuple[str, ...]
    heavy: bool = False
    wide: bool = False
    name: str = ""

    @property
    def text(self) -> str:
        """A sentence on whether the next mode is proved to take over, and on what is proved about it then."""
        if self.claim is None or self.lacks:
            return f"not taken over: {listed(self.lacks)}"
        given = f", assuming that {listed(self.assumed)}" if self.assumed else ""
        n, stored = self.claim.numbers, [f"{1e3 * self.momentum:.3g} mN m s of momentum"] * self.wide
        bounds = bounded(self.rate, self.angle, *stored)
        begun = f" {bounds}" if bounds else ""
        end = f"within {np.degrees(n['angle']):.3g}° of the target after {n['settling']:.4g} s"
        return f"taken over{begun}: {end}{given}"


def bounded(rate: float, angle: float, *more: str) -> str:
    """Return words about a state at up to a rate (rad/s), an angle (rad) and more, without those that are inf."""
    bounds = [f"{np.degrees(rate):.3g}°/s"] * (rate < inf) + [f"{np.degrees(angle):.3g}°"] * (angle < inf)
    return f"at up to {listed((*bounds, *more))}" if bounds or more else ""


def links_of(loop: ClosedLoop, name: str, certificates: Mapping[str, Certificate]) -> list[Link]:
    """Return the links of a law's modes, starting with the first mode, from the certificates of the modes and switches by
    name; switches back are not links. A mode with two claims has two links to the next one."""
    modes = names_of_modes(loop.law)
    flown: dict[str, Claim | None] = {mode: _flown(certificates.get(f"{name}: {mode}")) for mode in modes}
    switches = [one for one in hand_overs(loop, name) if one.key == "until"]
    links, reached = list[Link](), set[tuple[int, str, bool]]()

    def leave(place: int, last: Claim | None, begun: float, entry: str = "") -> None:
        leaving = [one for one in switches if one.places[0] == place]
        way = place, entry, any(_is_early(one, begun) for one in leaving)
        if way in reached:
            return
        reached.add(way)
        for one in leaving:
            before, after = modes[place], modes[one.places[1]]
            link = _link(one, before, after, last, flown[after], begun)
            wider = _flown(certificates.get(one.name)) if link.heavy else None
            other = _link(one, before, after, last, wider, begun)._replace(wide=True)
            link = link if other.lacks else other
            links.append(link)
            leave(one.places[1], link.claim, 0.0 if link.lacks else link.momentum, one.name if link.wide else "")

    for place, mode in enumerate(modes):
        if place not in {one for one, *_ in reached}:
            leave(place, flown[mode], 0.0)
    return links


def widened(loop: ClosedLoop, name: str, issued: Sequence[Issued], wanted: Wanted) -> list[Issued]:
    """Return the certificates of a law's modes. Where a switch may hand over more momentum than the next mode's claim
    assumes, the certificate of the switch gets a further claim about this mode as it flies, with that momentum."""
    every, tried = list(issued), set[str]()
    switches = {one.name: one for one in hand_overs(loop, name) if one.key == "until"}

    def heavy() -> Link | None:
        links = links_of(loop, name, {one.certificate.name: one.certificate for one in every})
        return next((one for one in links if one.heavy and one.momentum < inf and one.name not in tried), None)

    while (link := heavy()) is not None:
        tried.add(link.name)
        one = switches[link.name]
        sought = replace(wanted, alone=True, momentum=link.momentum, like=link.claim)
        wider = certify(one.after, link.name, sought)
        if wider.outcome != "proved" and link.claim is not None:
            # With more momentum from a smaller start, which the link then assumes.
            begun = link.claim.numbers["rate_start"]
            wider = certify(one.after, link.name, replace(sought, like=None, begun=begun))
        if wider.outcome != "proved":
            continue
        before, after = one.places
        if link.name not in [one.certificate.name for one in every]:
            every.append(Issued(replace(wider, claims=()), one.after, mode=after + 1, before=before + 1))
        last = max(k for k, one in enumerate(every) if one.certificate.name == link.name)
        given = every[last].certificate
        every[last] = every[last]._replace(certificate=replace(given, claims=(*given.claims, *wider.claims)))
    return every


def summary(links: Sequence[Link]) -> str:
    """Return a clause that counts the switches at which the next mode is proved to take over as the loop flies."""
    taken = sum(not link.lacks for link in links)
    return f"as it flies, {taken} of {len(links)} switches between modes lead into what is proved of the next mode"


def sentence(links: Sequence[Link]) -> str:
    """Return one sentence with what consecutive links prove, up to the first incomplete one; "" if that is the first."""
    follows = (k == 0 or link.before == links[k - 1].after for k, link in enumerate(links))
    taken = [link for link, _ in takewhile(lambda pair: not pair[0].lacks and pair[1], zip(links, follows, strict=True))]
    if not taken:
        return ""
    steps, assumed, shares = dict[str, None](), dict[str, None](), dict[str, None]()
    for link in taken:
        n = link.claim.numbers  # pyright: ignore[reportOptionalMemberAccess]
        # Repeated clauses appear once.
        steps[f"{link.after} comes within {np.degrees(n['angle']):.3g}° after {n['settling']:.4g} s"] = None
        assumed |= dict.fromkeys(link.assumed)
        if n["share"]:
            shares[f" in at least {100.0 * n['share']:.4g} % of spans of {n['samples'] * n['period']:.4g} s"] = None
    first = taken[0]
    angle = min(first.angle, first.claim.numbers["slew_angle"])  # pyright: ignore[reportOptionalMemberAccess]
    rate = f"up to {np.degrees(first.rate):.3g}°/s and " if first.rate < inf else ""
    begun = f"from {rate}within {np.degrees(angle):.3g}° of the target of {first.after}"
    given = f", assuming that {listed(tuple(assumed))}" if assumed else ""
    return f"{begun}, {', then '.join(steps)}, each of its target and counted from its begin{listed(tuple(shares))}{given}"


def chains(scenario: Scenario, certificates: list[Certificate], law: str | None = None) -> dict[str, list[Link]]:
    """Return the links of each law of modes of a scenario, or of one, initially and after each fault that it knows of, by
    the begin of their certificates' names."""
    from starhold.laws.modes import mode_laws
    from starhold.scenario.building import build
    from starhold.studies.bodies.rigid_body import named_loops

    def built(entry: LawEntry) -> list[tuple[str, ClosedLoop, int]]:
        loop = build(scenario, entry)
        modes = mode_laws(loop.law, loop.gains) if scenario.body == "rigid-body" else []
        return named_loops(scenario, entry, loop) if modes else []

    entries, issued = scenario.laws if law is None else (scenario.pick(law),), {one.name: one for one in certificates}
    every = [one for entry in entries for one in built(entry)]
    return {name: links for name, loop, _ in every if (links := links_of(loop, name, issued))}


def _flown(certificate: Certificate | None) -> Claim | None:
    claim = None if certificate is None else certificate.claim("pointing")
    return claim if claim is not None and claim.outcome == "proved" else None


def _link(one: HandOver, before: str, after: str, last: Claim | None, claim: Claim | None, begun: float) -> Link:
    """Return the link of a switch. last, claim: the claims about the previous and the next mode; begun: the momentum
    (N m s) with which the previous mode begins."""
    early = _is_early(one, begun)
    rate, angle = flown_ends(one.levels, one.before, one.after, None if early else last, claim)
    momentum = _momentum(one, last, rate)
    assumed = [] if last is None else _unending(one, before, last)
    assumed += [f"{before} ends"] if last is None else []
    if last is not None and not early and one.least < last.numbers["settling"]:
        assumed.append(f"{before} lasts {last.numbers['settling']:.4g} s")
    early = early and rate == inf
    if claim is not None and (angle == inf or early):
        fast = f" at up to {np.degrees(claim.numbers['rate_start']):.3g}°/s" if early else ""
        assumed.append(f"{after} begins within {np.degrees(claim.numbers['slew_angle']):.3g}° of its target{fast}")
    if claim is not None and (late := claim.numbers.get("late_torque")):
        # The next law may ask for another torque at once.
        assumed.append(f"{after} begins with a torque within {late:.4g} N m of its command")
    if claim is not None and "told_growth" in claim.numbers:
        # What the tests look at is then off as the body moves in the mode before.
        sure = flown_ends({}, one.before, one.after, None if early else last, claim)
        assumed += [f"{after} begins {bounds}" for bounds in [bounded(rate, angle)] if (rate, angle) != sure]
        assumed.append(f"{after} begins with no larger errors of what it is told than if the body had moved so before")
    assumed += [limited] if claim is not None and (limited := claim.limited_to(inf)) else []
    lacks = _lacking(before, after, claim, 0.0 if early else rate, angle)
    heavy = [] if claim is None else _heavy(after, claim, momentum)
    alone = bool(heavy) and not lacks
    return Link(before, after, rate, angle, momentum, claim, tuple(assumed), (*lacks, *heavy), alone, name=one.name)


def _is_early(one: HandOver, begun: float) -> bool:
    """Return whether a mode may end before it settles, because it begins with the momentum that ends it."""
    return begun > one.levels.get(STORED, inf)


def _unending(one: HandOver, before: str, last: Claim) -> list[str]:
    """Return the assumptions needed for a settled mode to end; none where it is no worse if the mode does not end."""
    n, settled = last.numbers, {STORED: -inf}
    if "told_growth" not in n:
        # Else how far off what it looks at is then depends on how the body moves.
        rate = n["rate"] + n["rate_error"]
        settled |= {"angle_below": n["angle"] + n["attitude_error"], "rate_below": rate + misjudged(one.before, last)}
        settled["body_rate_below"] = rate + above(make_subject(one.before).target_rate)
    unmet = [test for test, level in one.levels.items() if not settled.get(test, inf) < level]
    if unmet == [RELEASED]:
        return [f"{before} brings the wheels' momentum below {1e3 * one.levels[RELEASED]:.3g} mN m s"]
    return [f"{before} ends"] if unmet else []


def _momentum(one: HandOver, last: Claim | None, rate: float) -> float:
    """Return the largest momentum (N m s) with which a mode begins: the bound of the claim about the previous mode, or that
    of the switch; or, after a mode with inactive wheels, the initial momentum of the rotors plus that of the body."""
    # The rate is relative to the target.
    fastest = rate + above(make_subject(one.after).target_rate)
    fresh = fresh_momentum(one, fastest)
    if last is None or fresh < inf:
        return fresh
    return min(float(last.numbers.get("momentum", inf)), left_momentum(one, fastest))


def _lacking(before: str, after: str, claim: Claim | None, rate: float, angle: float) -> list[str]:
    """Return the reasons, apart from momentum, why the next mode's claim does not cover the states in which the previous
    mode ends."""
    if claim is None:
        return [f"nothing is proved of {after} as it flies"]
    n, clauses = claim.numbers, list[str]()
    if rate == inf:
        clauses.append(f"nothing bounds the rate at which {before} ends")
    elif rate > n["rate_start"]:
        shown = np.degrees(n["rate_start"])
        clauses.append(f"{before} may end at {np.degrees(rate):.3g}°/s, and {after} is proved from up to {shown:.3g}°/s")
    if n["slew_angle"] < angle < inf:
        clauses.append(f"{before} may end {np.degrees(angle):.3g}° from the target")
    return clauses


def _heavy(after: str, claim: Claim, momentum: float) -> list[str]:
    """Return a clause if the next mode may begin with more momentum than its claim assumes; else an empty list."""
    most = claim.numbers.get("momentum", inf)
    stored = "any" if momentum == inf else f"{1e3 * momentum:.3g} mN m s of"
    clause = f"{after} may begin with {stored} momentum, and is proved with up to {1e3 * most:.3g} mN m s"
    return [clause] if momentum > most else []
