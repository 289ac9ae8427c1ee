"""The chain of a mission's modes: whether what is proved of a mode as it flies begins where the mode before ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from starhold.studies.modes import HandOver, fresh_momentum, hand_overs

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate, Claim
    from starhold.loop.closed_loop import ClosedLoop
    from starhold.scenario.reading import LawEntry, Scenario


class Link(NamedTuple):
    """A switch to the next mode, with the modes' names. rate, angle, momentum: up to which the next mode begins (rad/s, rad,
    relative to its target, N m s), inf where nothing bounds them; claim: what is proved of the next mode as it flies, if
    anything; assumed: under which that is so; lacks: why the claim does not begin there."""

    before: str
    after: str
    rate: float
    angle: float
    momentum: float
    claim: Claim | None
    assumed: tuple[str, ...]
    lacks: tuple[str, ...]

    @property
    def text(self) -> str:
        """Say whether the next mode takes over, and what is proved of it then."""
        if self.claim is None or self.lacks:
            return f"not taken over: {listed(self.lacks)}"
        n = self.claim.numbers
        begun = f"at up to {np.degrees(self.rate):.3g}°/s" + (
            f" and {np.degrees(self.angle):.3g}°" if self.angle < inf else ""
        )
        end = f"within {np.degrees(n['angle']):.3g}° of the target after {n['settling']:.4g} s"
        given = f", assuming that {listed(self.assumed)}" if self.assumed else ""
        return f"taken over {begun}: {end}{given}"


def links_of(loop: ClosedLoop, name: str, certificates: Mapping[str, Certificate]) -> list[Link]:
    """Return the links of a law's modes, from the certificates of the modes by name; switches back are none."""
    modes = [mode.name for mode in loop.law.module.modes]  # pyright: ignore[reportAttributeAccessIssue]
    flown: dict[str, Claim | None] = {mode: _flown(certificates.get(f"{name}: {mode}")) for mode in modes}
    switches = [one for one in hand_overs(loop, name) if one.key == "until"]
    return [_link(one, modes[one.places[0]], modes[one.places[1]], flown) for one in switches]


def summary(links: Sequence[Link]) -> str:
    """Say of how many switches the next mode is proved to take over as the loop flies."""
    taken = sum(not link.lacks for link in links)
    return f"as it flies, {taken} of {len(links)} switches between modes lead into what is proved of the next mode"


def chains(scenario: Scenario, certificates: list[Certificate], law: str | None = None) -> dict[str, list[Link]]:
    """Return the links of each law of modes of a scenario, or of one, by the law's name."""
    from starhold.laws.modes import mode_laws
    from starhold.scenario.building import build

    def built(entry: LawEntry) -> list[Link]:
        loop = build(scenario, entry)
        modes = mode_laws(loop.law, loop.gains) if scenario.body == "rigid-body" else []
        return links_of(loop, entry.name, {one.name: one for one in certificates}) if modes else []

    entries = scenario.laws if law is None else (scenario.pick(law),)
    return {entry.name: links for entry in entries if (links := built(entry))}


def listed(clauses: tuple[str, ...]) -> str:
    """List clauses for a sentence."""
    return " and ".join(clauses)


def _flown(certificate: Certificate | None) -> Claim | None:
    claim = None if certificate is None else certificate.claim("pointing")
    return claim if claim is not None and claim.outcome == "proved" else None


def _link(one: HandOver, before: str, after: str, flown: Mapping[str, Claim | None]) -> Link:
    from starhold.certification.hand_over import flown_ends

    last, claim = flown[before], flown[after]
    rate, angle = flown_ends(one.levels, one.before, one.after, last, claim)
    momentum = _momentum(one, last, rate)
    assumed = [f"{before} ends"] if last is None else []
    if last is not None and one.least < last.numbers["settling"]:
        assumed.append(f"{before} lasts {last.numbers['settling']:.4g} s")
    if claim is not None and angle == inf:
        assumed.append(f"{after} begins within {np.degrees(claim.numbers['slew_angle']):.3g}° of its target")
    lacks = _lacking(before, after, claim, rate, angle, momentum)
    return Link(before, after, rate, angle, momentum, claim, tuple(assumed), tuple(lacks))


def _momentum(one: HandOver, last: Claim | None, rate: float) -> float:
    """Return the largest momentum with which a mode begins (N m s): that of the claim about the mode before; or that of the
    rotors at the start, which they keep in a mode in which wheels are inactive, and the body's."""
    fresh = fresh_momentum(one, rate)
    return fresh if last is None or fresh < inf else float(last.numbers.get("momentum", inf))


def _lacking(before: str, after: str, claim: Claim | None, rate: float, angle: float, momentum: float) -> list[str]:
    """Return why the claim of the next mode does not begin where the mode before ends."""
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
    if momentum > n.get("momentum", inf):
        stored = "any" if momentum == inf else f"{1e3 * momentum:.3g} mN m s of"
        clauses.append(
            f"{after} may begin with {stored} momentum, and is proved with up to {1e3 * n['momentum']:.3g} mN m s"
        )
    return clauses
