"""The page of laws, and a page for each."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from generators import formulas
from generators.tables import keys, table
from starhold.laws.catalogue import Law, catalogue

if TYPE_CHECKING:
    from collections.abc import Callable

HEAD = """# Laws

Written from the laws' own files by `make docs`, with a page for each; the formulas there are what SymPy reads in the
equations that fly.

$q_0$ and $q$ are the scalar and the vector part of the rotation from the target to the body, $\\omega$ the rate relative to
the target, $\\Omega$ the absolute one, $a$ the derivative of the target's rate, $J$ the inertia, $H$ the momentum of the
wheels, $M$ the modelled torque from outside, $T$ the control period; vectors are in body axes, and $^0$ marks what a law
remembers from the instant before. $\\dot V$ is along the motion to a target at rest, with unlimited
torque and without wheels. The `quaternion_sign` and the limits act on what these formulas give.

## Laws of attitude
"""
STATION = """
## Laws of station keeping

Numbers are scaled, see [station keeping](station-keeping.md): $r$ and $v$ are position and velocity from the
libration point in the turning axes, $C$ the stiffness of the linear model.
"""
POINT = "libration-point"


def page() -> str:
    """The page of laws."""
    return f"{HEAD}\n{laws_table('rigid-body', 'laws/')}\n{STATION}\n{laws_table(POINT, 'laws/')}\n"


def laws_table(body: str, folder: str) -> str:
    """The laws of a body by name, with links to their pages in this folder."""
    rows = [[f"[`{name}`]({folder}{name}.md)", law.card.summary, law.card.claims] for name, law in catalogue(body).items()]
    return table(["law", "control", "claims"], rows)


def pages() -> dict[str, Callable[[], str]]:
    """A page for each law, by its path."""
    shown = {"rigid-body": formulas.rigid_body, POINT: formulas.station}
    return {
        f"laws/{name}.md": partial(_described, law, formula)
        for body, formula in shown.items()
        for name, law in catalogue(body).items()
    }


def _described(law: Law, formula: Callable[[Law], list[str]]) -> str:
    """A law's card, formula, gains and forms."""
    card = law.card
    lines = [f"# {law.name}: {card.title}", "", card.summary.replace("*", "\\*"), "", f"* claims: {card.claims}"]
    lines += [f"* assumes: {'; '.join(card.assumptions)}", f"* sources: {'; '.join(card.sources)}", "", *formula(law)]
    for form in (None, *law.forms):
        lines += ["## Gains" if form is None else f'## Form "{form}"', "", *keys(law.fields(form)), ""]
    return "\n".join([*lines, "Symbols and units: [Laws](../laws.md).", ""])
