"""The section of the page on claims: which are proved about each law, which are not, and why."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from starhold.certification.assumptions import texts
from starhold.certification.certificate import FILE, Claim, Obligation
from starhold.certification.obligations import OBLIGATIONS
from starhold.certification.wording import HEADINGS, evidence, grouped, methods, recheck, statement, unclaimed
from starhold.report.tables import Markup, listed, pill, swatch, table_html
from starhold.report.text import left_text, number_text, unflown_text
from starhold.studies.flight import Flight

NOTE = (
    "Proved means shown by a computation without rounding errors: identities and inequalities in exact rational numbers, "
    "the rest in ball arithmetic, which bounds its own error. No claim rests on samples or on flights. Refuted: a condition "
    "of the proof is false at the state shown; the proof then fails, and the law itself may or may not. Undecided: neither "
    "was shown. A claim is about motions that meet its assumptions, listed inside; where the flight on this page does not, "
    "the page says so and from when on. Torque held between samples counts as such a case unless its stability is proved. "
)
RECHECK = f"The proofs are in {FILE} beside this page; <code>%s</code> checks them again."

SYMBOLS = {
    "start": ("V at the start, at most", ""),
    "level": ("V from then on, at most", ""),
    "stiffness": ("k of V = ω·Jω/2 + 2k(1 − q₀), in place of the law's own V", "N m"),
    "p": ("V = ω·ω/2 + a²(p u + c₂ u²) − a (g + m u) q·ω, u = 1 − q₀: p", ""),
    "c2": ("c₂", ""),
    "g": ("g", ""),
    "m": ("m", ""),
    "mu": ("μ in (σ² + μx²)/2, σ = x + ẋ/s", ""),
    "reach": ("|x|, at most", ""),
    "epsilon": ("ε in V + ε q·Jω", ""),
    "soft": ("share of V's potential that is taken, as if the target pulled less", ""),
    "moment": ("moment of inertia about all axes that stands for J in V", "kg m²"),
    "rho": ("bound on the added term, as a share of V", ""),
    "rate_bound": ("rate up to which V is shown to be non-increasing", "rad/s"),
    "tau": ("τ: a torque M does work of at most τ |Wᵀω + εq|² + M²/(4τ)", ""),
    "beta": ("β: decay rate left, as a share of V + ε q·Jω", "1/s"),
    "shift": ("p in |ω × Jω| ≤ |ω| |(J + p)ω|", ""),
    "weight": ("c in |ω| |(J + p)ω| ≤ (c |ω|² + |(J + p)ω|²/c)/2", ""),
    "momentum": ("total angular momentum, at most", "N m s"),
    "motors": ("torque of each motor, at most", "N m"),
    "wheel_momentum": ("momentum of each wheel, at most", "N m s"),
    "kinetic": ("ω·Jω, relative to the target, at most", "J"),
    "asked_torque": ("torque that the law asks for because of state and momentum alone, about an axis at most", "N m"),
    "asked_motors": ("torque that it asks of each motor because of state and momentum alone, at most", "N m"),
    "margin": ("torque in hand on the weakest axis", "N m"),
    "surface": ("|s| in the end, at most", "rad/s"),
    "radius": ("spectral radius at the control period, at most", ""),
    "eigenvalues": ("eigenvalues at the control period", ""),
    "longest": ("longest period shown", "s"),
}
"""The numbers of a proof that no sentence states, with the meaning and unit of each; the unit of V depends on the law."""


def section(flights: Sequence[Flight]) -> str:
    """Return the section as HTML; "" where no flight has a certificate."""
    blocks = [_law(flight, number, i) for number, flight in enumerate(flights) for i in range(len(flight.certificates))]
    if not blocks:
        return ""
    command = escape(recheck([certificate for flight in flights for certificate in flight.certificates]))
    return f'<p class="note">{NOTE}{RECHECK % command}</p>\n<div class="laws">{"".join(blocks)}</div>'


def _law(flight: Flight, number: int, place: int) -> str:
    certificate = flight.certificates[place]
    head = f"<h3>{swatch(number)}{escape(certificate.name)}</h3>"
    marks = {claim.kind: f"{number}:{place}:{i}" for i, claim in enumerate(certificate.claims)}
    groups = [
        (heading, [_claim(c, certificate.subject, left_text(flight, place, c.kind), marks[c.kind]) for c in claims])
        for heading, claims in grouped(certificate).items()
    ]
    # Claims that leave out more of the loop stay folded.
    claims = "".join(
        f'<details class="share"{opened}><summary>{escape(_sentence_case(heading))}</summary>{"".join(parts)}</details>'
        for opened, (heading, parts) in zip([" open", *[""] * len(groups)], groups, strict=False)
    )
    if not claims:
        why = escape(unclaimed(certificate.subject))
        claims = f'<p class="note">Nothing is claimed, so nothing is proved: {why}.</p>'
    word, text = unflown_text(certificate)
    if word:
        claims = f"<p>{pill(word)} {escape(_sentence_case(text))}.</p>{claims}"
    if certificate.law:
        claims += (
            f'<p class="note">Program of the law, in its C code and its run too: SHA-256 <code>{certificate.law}</code>.</p>'
        )
    return f'<section class="law">{head}{claims}</section>\n'


def _claim(claim: Claim, subject: Mapping[str, Any], left: str, mark: str) -> str:
    text = statement(claim, subject)
    why = "".join(
        f'<span class="why">{escape(f"Needed, but {o.outcome}: {OBLIGATIONS[o.name]}.")} <b>{escape(evidence(o))}</b></span>'
        for o in claim.obligations
        if o.outcome != "proved"
    )
    if left:
        why += f'<span class="why left">This flight leaves the claim: <b>{escape(left)}.</b></span>'
    rows = [[Markup(pill(o.outcome)), _obligation(o), o.how] for o in claim.obligations]
    return (
        f'<details class="claim" data-claim="{mark}"><summary>{pill(claim.outcome)}<span class="what">'
        f"<b>{escape(_sentence_case(HEADINGS[claim.kind]))}</b> {escape(_sentence_case(text))}. "
        f"<small>By {escape(methods(claim))}.</small>{why}</span></summary>\n"
        f"{table_html(listed(rows), 'text')}{_numbers(claim)}"
        f"<p><b>Assuming</b> {escape('; '.join(texts(claim.assumptions)))}.</p></details>\n"
    )


def _obligation(obligation: Obligation) -> Markup:
    text = OBLIGATIONS.get(obligation.name, obligation.name)
    reason = f"<br><b>{escape(evidence(obligation))}</b>" if obligation.evidence else ""
    return Markup(f"{escape(_sentence_case(text))}{reason}")


def _numbers(claim: Claim) -> str:
    """Return a table of the numbers behind a claim's sentence, without infinite ones and an unneeded cross term."""
    values = claim.numbers | {name: value for name, value in claim.witness.items() if value}
    items = [
        f"<dt>{escape(meaning)}</dt><dd>{escape(_text(name, values[name]))}{f' {escape(unit)}' if unit else ''}</dd>"
        for name, (meaning, unit) in SYMBOLS.items()
        if values.get(name) is not None
    ]
    return f'<dl class="proof">{"".join(items)}</dl>' if items else ""


def _sentence_case(text: str) -> str:
    return text[:1].upper() + text[1:]


def _text(name: str, value: Any) -> str:
    if name != "eigenvalues":
        return number_text(value)
    pairs = (f"{real:.6g}{f' {chr(0xB1)} {imaginary:.3g} i' if imaginary else ''}" for real, imaginary in value)
    # Conjugate pairs are shown as one.
    return ", ".join(dict.fromkeys(pair.replace("± -", "± ") for pair in pairs))
