"""Certificates in sentences. Every number in them comes from the claim."""

import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from starhold.certification.assumptions import LINEAR, UNLIMITED, UNLIMITED_CONTROL, WHEELS
from starhold.certification.certificate import FILE, FRESH, ORBIT, STEADY, UNTIL, Certificate, Claim, Obligation
from starhold.certification.obligations import OBLIGATIONS
from starhold.certification.rounding import angle, growing, shown, speed
from starhold.laws.catalogue import file_of, known_law

HEADINGS = {
    "convergence": "converges",
    "hand-over": "takes over",
    "region": "region of attraction",
    "torque-limit": "within the torque limit",
    "inertia": "uncertain inertia",
    "wheels": "within the wheels' limits",
    "pointing": "pointing as it flies",
    "appendages": "pointing with appendages",
    "sampling": "torque held between samples",
    "sliding": "reaches its surface",
    "detumbling": "loses energy",
    "circle": "ends on the circle",
    "control-limit": "within the control's limit",
    "equilibrium": "comes to rest",
    "saturated-axis": "X with limited control",
}


def sentence(claim: Claim, subject: Mapping[str, Any]) -> str:
    """Return the claim as a sentence, whether or not it is proved, with its decisive assumption about the loop's limits.
    Refuted numbers are rounded so that the sentence says no less."""
    # The parts that a claim leaves out decide its value.
    absent = claim.left_out
    return (f"without {enumerated(absent)}, " if absent else "") + statement(claim, subject)


def statement(claim: Claim, subject: Mapping[str, Any]) -> str:
    """The claim in a sentence without the parts that it leaves out."""
    numbers = {**claim.numbers, "refuted": claim.outcome == "refuted"}
    orbit = "".join(f", on an orbit within {100.0 * share:.3g} % of a two-body one" for share in claim.numbers_of(ORBIT))
    return _unbounded(claim, subject) + _SENTENCES[claim.kind](numbers, subject) + orbit


def ranked(certificate: Certificate) -> list[Claim]:
    """The claims, those that leave out the fewest parts of the loop first."""
    return sorted(certificate.claims, key=lambda claim: len(claim.left_out))


def strongest(claims: Sequence[Claim]) -> list[Claim]:
    """The claims, those about the motion before those about its linear form; of these the proved first, then those that
    leave out the fewest parts of the loop, of these the one about the loop as it flies."""
    return sorted(claims, key=lambda c: (c.kind == "sampling", c.outcome != "proved", len(c.left_out), c.kind != "pointing"))


def grouped(certificate: Certificate) -> dict[str, list[Claim]]:
    """The claims as they are ranked, those that leave out the same parts under a text that says which."""
    groups: dict[str, list[Claim]] = {}
    for claim in ranked(certificate):
        absent = claim.left_out
        without = f"without {enumerated(absent)}" if absent else ""
        groups.setdefault(", ".join(filter(None, (coverage(claim, certificate.subject), without))), []).append(claim)
    return groups


def coverage(claim: Claim, subject: Mapping[str, Any]) -> str:
    """State how many of the loop's parts a claim includes; empty where the loop's parts are not known."""
    count, absent = subject.get("parts"), len(claim.left_out)
    if not count:
        return ""
    if absent:
        return f"of the loop's {count} parts {count - absent} {'is' if count - absent == 1 else 'are'} in it"
    return f"all {count} parts of the loop are in it" if count > 1 else "the loop's only part is in it"


def enumerated(names: Sequence[str]) -> str:
    """Parts, each as role and name, for reading: "the sensors gyro and star-tracker and the estimator mekf"."""
    roles: dict[str, list[str]] = {}
    for role, _, name in (text.partition(" ") for text in names):
        roles.setdefault(role, []).append(name)
    return listed([f"the {role}{'s' * (len(parts) > 1)} {listed(parts)}" for role, parts in roles.items()])


def listed(words: Sequence[str]) -> str:
    """List items for a sentence."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _unbounded(claim: Claim, subject: Mapping[str, Any]) -> str:
    kept = "between jumps of its target, " * (STEADY in claim.assumptions)
    kept += "".join(f"for the flight's first {end:.6g} s, " for end in claim.numbers_of(UNTIL))
    for age in claim.numbers_of(FRESH):
        kept += f"while directions give an attitude {f'each {age:.6g} s' if age else 'at each control instant'}, "
    return kept + _ideal(claim, subject)


def _ideal(claim: Claim, subject: Mapping[str, Any]) -> str:
    if LINEAR in claim.assumptions:
        return ""
    if WHEELS in claim.assumptions:
        return "with wheels that have neither limits nor friction, "
    limited = subject.get("limit", "none") != "none"
    if UNLIMITED in claim.assumptions and limited and subject.get("torque_limit") is not None:
        return "with unlimited torque, "
    if UNLIMITED_CONTROL in claim.assumptions and limited and subject.get("control_limit") is not None:
        return "with unlimited control, "
    return ""


def place(numbers: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    """The set that a motion starts from."""
    more = bool(numbers.get("refuted"))
    if numbers.get("everything"):
        return "from every attitude and rate"
    rate = numbers.get("rate_everywhere")
    if rate is not None:
        return "from every attitude and rate" if math.isinf(rate) else f"from every attitude at up to {speed(rate, more)}"
    turn, on_target = numbers.get("slew_angle"), numbers.get("rate_start", numbers.get("rate"))
    if turn is None:
        return ""
    contained = _rests(turn, subject, more)
    contained += f" and, on target, {speed(on_target, more)} about any axis" if on_target else ""
    return f"from the level set of V that holds {contained},"


def _rests(turn: float, subject: Mapping[str, Any], more: bool) -> str:
    """Describe states at rest rotated up to an angle; an attitude has two quaternions, and the angle of the other is 360°
    less."""
    if turn < math.pi:
        return f"rest at up to {angle(turn, more)}"
    most = {"shortest": math.pi}
    if subject["quaternion_sign"] == "hysteresis":
        most["hysteresis"] = 2.0 * math.acos(-min(subject["hysteresis_width"], 1.0)) * (1.0 + 1e-15)
    if _even(subject) or turn >= most.get(subject["quaternion_sign"], 2.0 * math.pi):
        return "rest at every attitude"
    return f"rest at every attitude by the shorter rotation, and by the longer one up to {angle(turn, more)} of 360°"


def unclaimed(subject: Mapping[str, Any]) -> str:
    """Return why a certificate claims nothing."""
    if "body" in subject:
        return f"no theorem is about the body {subject['body']}"
    return "but for pointing as it flies, proofs are for laws with a Lyapunov function, one root, or a surface and no wheels"


def _even(subject: Mapping[str, Any]) -> bool:
    """Return whether the law treats both quaternions of an attitude alike."""
    return (law := known_law(subject.get("law", ""))) is not None and law.card.quaternion_sign == "even"


def _cover(numbers: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    everywhere = numbers.get("everything") or numbers.get("rate_everywhere") is not None
    if _even(subject):
        return ", almost always: it could also rest at half turns, which are unstable" if everywhere else ""
    if subject["quaternion_sign"] == "hysteresis":
        whole = ", whichever quaternion it starts with: global on rotations, and robust by its hysteresis"
        return whole if everywhere else ", robust by its hysteresis"
    if subject["quaternion_sign"] == "shortest":
        return " by the shorter way; at half a turn the feedback switches, and noise may hold it there"
    if everywhere:
        return ", almost always at q0 = 1; it may turn the long way to get there (unwinding)"
    return ""


def _followed(subject: Mapping[str, Any]) -> str:
    """State the assumption on the target's motion, between the rows of its history, for a bound that depends on it."""
    followed = subject.get("target") == "history" and subject["target_rate"]
    return ", while the target follows the rotation spline through its history" if followed else ""


def _hand_over(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    def most(value: float, unit: str) -> str:
        # Without the rounding of the law's own comparison.
        return shown(float(f"{math.degrees(value):.12g}"), unit, up=True)

    bounds = [f"a rate of at most {most(n['rate'], '°/s')}"] if n["rate"] is not None else []
    bounds += [f"an angle of at most {most(n['angle'], '°')}"] if n["angle"] is not None else []
    where = f"with {' and '.join(bounds)}" if bounds else "with any attitude and rate"
    return f"wherever the mode before hands over, {where}, the body comes to rest on target{_cover(n, subject)}"


def _region(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    either = ", from either quaternion of an attitude" if subject["quaternion_sign"] == "hysteresis" else ""
    return f"{place(n, subject) or 'from a level set of V'} the body comes to rest on target without leaving the set{either}"


def _torque_limit(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    kind = "on every axis" if n["kind"] == "axis" else "in norm"
    most = shown(n["limit"], " N m", up=not n["refuted"])
    return f"{place(n, subject)} the torque never exceeds {most} {kind}{_followed(subject)}"


def _wheels(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    if "momentum" not in n:
        return "no motor of a wheel reaches its limit"
    parts: list[str] = []
    for text, name, unit in (("motor{} gives", "motors", " N m"), ("wheel{} stores", "wheel_momentum", " N m s")):
        limits = [x for x in n.get(name, ()) if x is not None]
        if limits:
            which = text.format("" if len(limits) == len(n[name]) else " with a limit")
            parts.append(f"no {which} more than {shown(max(limits), unit, up=True)}")
    while_ = f"while the total momentum is at most {shown(n['momentum'], ' N m s')}"
    return f"{place(n, subject)} {while_}, {' and '.join(parts)}{_followed(subject)}"


OFF = "every entry of the inertia off by up to {} of sqrt(J_ii J_jj)"


def _inertia(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    if n["tolerance"] is None:
        return f"{place(n, subject)} it converges whatever the inertia of the body really is"
    return f"{place(n, subject)} it converges with {OFF.format(shown(100.0 * n['tolerance'], ' %'))}".strip()


def _pointing(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    if "angle" not in n:
        return f"a torque from outside of up to {shown(n['torque'], ' N m')} leaves the body near the target"
    turned = angle(n["slew_angle"])
    start = f"up to {turned} at up to {speed(n['rate_start'])}" if n["rate_start"] else f"rest at up to {turned}"
    start += f" with states of the appendages of up to {', '.join(map(shown, n['begun']))}" if "begun" in n else ""
    kinds = (("attitude_error", angle, "errors of the attitude"), ("rate_error", speed, "errors of the rate"))

    def pushed(name: str) -> str:
        more = f" and {shown(grown, ' N m s')} times the body's rate" if (grown := n[f"{name}_per_rate"]) else ""
        return f"of up to {shown(n[name], ' N m')}{more}"

    random = f", random ones of up to {shown(n['random_torque'], ' N m')}" if "random_torque" in n else ""
    bounds = [f"torques from outside {pushed('torque')}{' beside those that the law is told' * bool(n['told'])}{random}"]
    bounds += [f"{what} of up to {write(n[name])}" for name, write, what in kinds if n[name] > 1e-12]
    bounds += [*growing(n.get("told_growth")), *([f"errors of the command {pushed('error')}"] if n["error"] else [])]
    bounds += [f"a lag of the torque, at first of up to {shown(n['late_torque'], ' N m')}"] if "late_torque" in n else []
    bounds += [f"a total momentum of up to {shown(n['momentum'], ' N m s')}"] if "momentum" in n else []
    bounds[-1] += " of the inertia as given" * ("momentum" in n and "tolerance" in n)
    bounds += [OFF.format(shown(100.0 * n["tolerance"], " %"))] if "tolerance" in n else []
    bounds += [f"a memory that adds up to {shown(n['memory'], ' N m')} about each axis"] if "memory" in n else []
    bounds += [f"a plan within {shown(n['plan_error'], ' N m', up=True)} of a polynomial"] if "plan_error" in n else []
    span = "orbits" if subject["orbit"] else f"spans of {n['samples'] * n['period']:.6g} s"
    share = f", in at least {shown(100.0 * n['share'], ' %')} of {span}" if n["share"] else ""
    near = f"within {angle(n['angle'], up=True)} of the target after {shown(n['settling'], ' s', up=True)} at all times"
    return f"{near}{share}, from {start}, torque held for {n['period']:.12g} s, with {listed(bounds)}{_followed(subject)}"


def _sampling(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    text = f"the linear loop is stable with the torque held for {n['period']:.12g} s"
    if n["longest"] is None:
        return text
    periods = "every period up to {}" if n["every_shorter"] else "{} (periods between these are not shown)"
    return f"{text} and for {periods.format(shown(n['longest'], ' s'))}"


def _sliding(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    most = max(n["torque"])
    against = f"against any torque from outside of up to {shown(most, ' N m', n['refuted'])} on an axis"
    if not most:
        against = "without torque from outside"
    if "angle" not in n:
        return f"the surface is reached {against}"
    where = place(n, subject)
    if not n["everything"]:
        where = place({**n, "rate_everywhere": None}, subject).replace("level set of V", "level set of s.Js")
    end = "slides to rest on target"
    if n["surface"]:
        end = f"ends within {angle(n['angle'], True)} and {speed(n['rate'], True)} of the target, at either quaternion of it"
    return f"{where} the motion reaches the surface {against} and {end}"


def _detumbling(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    if "rates" not in n:
        return "the energy decreases where the magnetic field turns in the body"

    # Rates between, by how much the energy increases and for how long the field turns fast are in the certificate.
    ends = sorted({0, len(n["rates"]) - 1})
    falls = [f"{speed(n['turning'][k], True)} up to {speed(n['rates'][k])}" for k in ends]
    return (
        f"energy decreases in each control period in which the field turns in the body by over {', '.join(falls)}; field ≥"
        f" {shown(n['field'], ' T', True)}, changing ≤ {shown(100.0 * n['field_change'], ' %')}/s; torques ≤"
        f" {shown(n['torque'], ' N m')}, across it {shown(n['torque_across'], ' N m')}"
    )


def _circles(n: Mapping[str, Any]) -> str:
    if "inner" not in n:
        return ""
    band = f"circles of radius {shown(n['inner'], up=True)} to {shown(n['outer'])} at the same rate"
    off = f"on the circle, velocities off by {shown(n['velocity'])} (scaled)"
    return f"from the level set of V that holds {band} and, {off},"


def _control_limit(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    kind = "on every axis" if n["kind"] == "axis" else "in norm"
    limit = shown(n["limit"], " (scaled)", up=not n["refuted"])
    return f"{_circles(n)} with x = 0, the control never exceeds {limit} {kind}".strip()


def _saturated_axis(n: Mapping[str, Any], subject: Mapping[str, Any]) -> str:
    where = f"with Y and Z held and the control along X within {n['limit']:.12g} (scaled)"
    if "width" not in n:
        return f"{where}, x returns"
    share = f"{shown(100.0 * n['width'] / n['boundary'], ' %')} of the true bound"
    return (
        f"{where}, x returns from |x + x'/s| up to {shown(n['width'])}, {share}, and |x| up to {shown(n['reach'])}; "
        f"from |x + x'/s| = {shown(n['boundary'], up=True)} on nothing returns"
    )


_SENTENCES: Mapping[str, Callable[[Mapping[str, Any], Mapping[str, Any]], str]] = {
    "convergence": lambda n, subject: f"{place(n, subject)} the body comes to rest on target{_cover(n, subject)}".strip(),
    "hand-over": _hand_over,
    "region": _region,
    "torque-limit": _torque_limit,
    "wheels": _wheels,
    "inertia": _inertia,
    **dict.fromkeys(("pointing", "appendages"), _pointing),
    "sampling": _sampling,
    "sliding": _sliding,
    "detumbling": _detumbling,
    "circle": lambda n, subject: f"{_circles(n)} the motion ends on the circle".strip(),
    "control-limit": _control_limit,
    "equilibrium": lambda n, subject: "from everywhere the motion comes to rest where it is wanted",
    "saturated-axis": _saturated_axis,
}


def eigenvalues(claim: Claim) -> str:
    """The eigenvalues of a sampled loop, one of each conjugate pair; empty for other claims."""
    shown_once: list[str] = []
    for real, imaginary in claim.numbers.get("eigenvalues", []):
        if imaginary >= 0.0:
            digits = _telling(complex(real, imaginary))
            shown_once.append(f"{real:.{digits}g}" + (f" ± {imaginary:.{digits}g} i" if imaginary else ""))
    return ", ".join(dict.fromkeys(shown_once))


def _telling(z: complex) -> int:
    """Show enough digits of an eigenvalue to tell on which side of the unit circle it lies."""
    cut = (abs(complex(float(f"{z.real:.{n}g}"), float(f"{z.imag:.{n}g}"))) >= 1.0 for n in range(6, 17))
    return next((n for n, outside in enumerate(cut, 6) if outside == (abs(z) >= 1.0)), 17)


def evidence(obligation: Obligation) -> str:
    """Why an obligation is refuted or undecided."""
    details = obligation.evidence
    if "reason" in details:
        return str(details["reason"])
    parts: list[str] = []
    for key, value in details.items():
        if key == "state":
            q, w = (", ".join(f"{x:.4g}" for x in value[name]) for name in ("attitude", "rate"))
            parts.append(f"q = ({q}), w = ({w}) rad/s")
        elif isinstance(value, list):
            parts.append(f"{key} = {_numbers(cast(Any, value))}")
        else:
            parts.append(f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}")
    return "; ".join(parts)


def reasons(claim: Claim) -> list[str]:
    """Why a claim is not proved, one line an obligation."""
    return [
        f"needed, but {o.outcome}: {OBLIGATIONS[o.name]}; {evidence(o)}" for o in claim.obligations if o.outcome != "proved"
    ]


def _numbers(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_numbers(x) for x in cast(list[Any], value))}]"
    return f"{value:.5g}"


def recheck(certificates: Sequence[Certificate], path: Path | None = None) -> str:
    """Return the command that checks a file of certificates again, with the files of its laws; without a path all files by
    name alone, for a page or a header that may be moved."""
    files = dict.fromkeys(file_of(str(one.subject.get("law"))) for one in certificates)
    named = [(file if path else file.name) for file in files if file is not None]
    return shlex.join(
        ["starhold", "check", str(path or FILE), *(word for file in named for word in ("--law-file", str(file)))]
    )


def methods(claim: Claim) -> str:
    """State how a claim was shown."""
    return ", ".join(dict.fromkeys(obligation.how for obligation in claim.obligations))
