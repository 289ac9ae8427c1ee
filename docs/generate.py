"""Writes docs/laws.md from the laws' own files: cards, gains, and the torque as SymPy reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import sympy

from starhold.laws.catalogue import Law, catalogue
from starhold.laws.interface import NoMemory, Seen
from starhold.laws.station.interface import station_laws
from starhold.models.craft import Craft, make_craft

CRAFT = make_craft([2.0, 3.0, 4.0])


def vector(name: str) -> tuple[Any, ...]:
    """Three symbols."""
    return sympy.symbols(f"{name}_1:4", real=True)


def first_component(law: Law) -> str:
    """The first component of the torque at a target at rest, for a body with principal axes, as text."""
    q, w = sympy.symbols("q_0:4", real=True), vector("w")
    zero = (sympy.Integer(0),) * 3
    seen = Seen(q, w, w, zero, zero, vector("M"), vector("R"), sympy.Symbol("T"))
    gains: list[Any] = []
    for item in law.fields():
        if item.gain.shape == (3, 3):
            k = sympy.Symbol(item.name, real=True)
            gains.append((k, k, k))
        else:
            gains.append(vector(item.name) if item.gain.shape else sympy.Symbol(item.name, real=True))
    moments = vector("J")
    craft = Craft(moments, tuple(1 / m for m in moments), sympy.Symbol("u_max"), sympy.Symbol("mu"))
    torque, _ = law.torque(seen, law.gains(*gains), craft, NoMemory())
    return str(sympy.simplify(torque[0]))


def described(law: Law) -> list[str]:
    """A law's card, gains and forms."""
    card = law.card
    lines = [f"## {law.name}: {card.title}", "", card.summary, "", f"* claims: {card.claims}"]
    lines += [f"* assumes: {'; '.join(card.assumptions)}", f"* sources: {'; '.join(card.sources)}", ""]
    for form in (None, *law.forms):
        lines += [
            "Gains:" if form is None else f'Form `"{form}"`:',
            "",
            "| key | unit | meaning | default |",
            "|---|---|---|---|",
        ]
        for item in law.fields(form):
            default = item.gain.choices[item.default] if item.gain.choices and not item.required else item.default
            shown = "required" if item.required else f"`{default}`"
            lines.append(f"| `{item.name}` | {item.gain.unit} | {item.gain.text} | {shown} |")
        lines.append("")
    return lines


def page() -> str:
    """The page."""
    lines = ["# Laws", "", "Written from the laws' own files by `make docs`.", ""]
    for law in catalogue().values():
        lines += described(law)
        if law.remember(law.examples()[0], CRAFT, 0.1) == NoMemory():
            text = "First component of the torque, target at rest, principal axes, matrix gains multiples of the identity:"
            lines += [text, "", f"    u_1 = {first_component(law)}", ""]
    lines += ["# Laws of station keeping", "", "Numbers are scaled, see [station keeping](station-keeping.md).", ""]
    for law in station_laws().values():
        lines += described(law)
    return "\n".join(lines)


if __name__ == "__main__":
    Path(__file__).with_name("laws.md").write_text(page(), encoding="utf-8")
