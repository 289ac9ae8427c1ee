"""The page of laws."""

from __future__ import annotations

from generators import formulas
from generators.tables import keys
from starhold.laws.catalogue import Law, catalogue

HEAD = """# Laws

Written from the laws' own files by `make docs`; the formulas are what SymPy reads in the equations that fly.

$q_0$ and $q$ are the scalar and the vector part of the rotation from the target to the body, $\\omega$ the rate relative to
the target, $\\Omega$ the absolute one, $a$ the derivative of the target's rate, $J$ the inertia, $H$ the momentum of the
wheels, $M$ the modelled torque from outside, $T$ the control period; vectors are in body axes, and $^0$ marks what a law
remembers from the instant before. $\\dot V$ is along the motion to a target at rest, with unlimited
torque and without wheels. The `quaternion_sign` and the limits act on what these formulas give.
"""


def described(law: Law, heading: str, formula: list[str]) -> list[str]:
    """A law's card, formula, gains and forms."""
    card = law.card
    lines = [f"{heading} {law.name}: {card.title}", "", card.summary, "", f"* claims: {card.claims}"]
    lines += [f"* assumes: {'; '.join(card.assumptions)}", f"* sources: {'; '.join(card.sources)}", "", *formula]
    for form in (None, *law.forms):
        lines += ["Gains:" if form is None else f'Form `"{form}"`:', "", *keys(law.fields(form)), ""]
    return lines


def page() -> str:
    """The page of laws."""
    lines = [HEAD]
    for law in catalogue().values():
        lines += described(law, "##", formulas.rigid_body(law))
    lines += ["## Laws of station keeping", ""]
    lines += [
        "Numbers are scaled, see [station keeping](station-keeping.md): $r$ and $v$ are position and velocity from the"
    ]
    lines += ["libration point in the turning axes, $C$ the stiffness of the linear model.", ""]
    for law in catalogue("libration-point").values():
        lines += described(law, "###", formulas.station(law))
    return "\n".join(lines)
