"""Laws as LaTeX: their equations are called with symbols, and what comes back is told in vectors where it can be.

A candidate is a vector that laws are made of, such as w x Jw. What is left of the torque is divided by each candidate's
first term; the quotient, where it is a scalar, is taken as the candidate's coefficient. The formula that is found has
exactly the components of the equations, or is none.
"""

from __future__ import annotations

import re
from typing import Any

import sympy

from starhold.algebra.scalar import absolute, clip, sign, sqrt
from starhold.algebra.vector import add, apply, cross, dot, scale, subtract, times
from starhold.laws.catalogue import Law
from starhold.laws.interface import Measurement, NoMemory
from starhold.laws.point import PointMeasurement
from starhold.parts.bodies.libration_point import Libration
from starhold.parts.craft import Craft

GREEK = ("alpha", "beta", "phi")
MOST_OPERATIONS = 100
"""Longer components are not printed: nobody reads them."""
MOST_TO_SORT = 500
"""In a longer component no vectors are looked for."""


def symbol(name: str) -> Any:
    """A key of a scenario as a symbol: k_rate with an index, longer names as they are written in files."""
    head, _, tail = name.partition("_")
    if re.fullmatch(r"[a-z]\d", name):
        head, tail = name
    if head in GREEK:
        return sympy.Symbol(f"\\{head}_{{{tail}}}" if tail else f"\\{head}", real=True)
    if len(head) == 1:
        return sympy.Symbol(f"{head}_{{\\mathrm{{{tail}}}}}" if tail else head, real=True)
    return sympy.Symbol("\\mathrm{" + name.replace("_", "\\_") + "}", real=True)


def vector(letter: str) -> tuple[Any, ...]:
    """Three components."""
    return tuple(sympy.Symbol(f"{letter}_{{{axis}}}", real=True) for axis in "xyz")


def matrix(letter: str) -> tuple[tuple[Any, ...], ...]:
    """A symmetric matrix."""
    rows = [[sympy.Symbol(f"{letter}_{{{''.join(sorted(a + b))}}}", real=True) for b in "xyz"] for a in "xyz"]
    return tuple(map(tuple, rows))


Q0 = sympy.Symbol("q_0", real=True)
Q, W, ABSOLUTE, ACCELERATION = vector("q"), vector(r"\omega"), vector(r"\Omega"), vector("a")
OUTSIDE, MOMENTUM, INERTIA = vector("M"), vector("H"), matrix("J")
PERIOD = sympy.Symbol("T", positive=True)
R, V = vector("r"), vector("v")
COMPONENTS = {s for v in (Q, W, ABSOLUTE, ACCELERATION, OUTSIDE, MOMENTUM, R, V) for s in v} | {
    s for r in INERTIA for s in r
}


def exact(value: Any) -> Any:
    """Floats of the equations as the fractions that they stand for."""
    expression = sympy.sympify(value)
    return expression.xreplace({x: sympy.Rational(x).limit_denominator(10**6) for x in expression.atoms(sympy.Float)})


CASES: dict[Any, Any] = {}
"""A symbol for each expression by cases, so that sums of them are sums of symbols."""


def _opaque(cases: Any) -> Any:
    return CASES.setdefault(cases, sympy.Dummy(f"p{len(CASES)}", positive=True))


def summed(value: Any) -> Any:
    """A component as a sum of products, with cases as symbols."""
    return sympy.expand(exact(sympy.sympify(value).replace(lambda e: isinstance(e, sympy.Piecewise), _opaque)))


class Formula:
    """A sum that is being found: what is left of the components, and the terms so far."""

    def __init__(self, components: tuple[Any, ...], own: set[Any]) -> None:
        self.left = [summed(c) for c in components]
        self.terms: list[tuple[Any, str]] = []
        self.own = COMPONENTS | own

    def take(self, candidate: tuple[Any, ...], name: str) -> None:
        """Take as much of a candidate as there is."""
        parts = [summed(c) for c in candidate]
        first = sympy.Add.make_args(parts[0])[0]
        if first == 0:
            return
        coefficient = sympy.Integer(0)
        for term in sympy.Add.make_args(self.left[0]):
            quotient = sympy.cancel(term / first) if term != 0 else term
            if not quotient.free_symbols & (self.own | {*CASES.values()}) and quotient.is_polynomial():
                coefficient += quotient
        left = [sympy.expand(r - coefficient * p) for r, p in zip(self.left, parts, strict=True)]
        if coefficient != 0 and _size(left) < _size(self.left):
            self.left = left
            self.terms.append((sympy.factor(coefficient), name))

    @property
    def found(self) -> bool:
        """Whether nothing is left."""
        return all(r == 0 for r in self.left)

    def latex(self) -> str:
        """The sum."""
        shown = ""
        for coefficient, name in self.terms:
            negative = coefficient.could_extract_minus_sign()
            size = -coefficient if negative else coefficient
            text = "" if size == 1 else sympy.latex(size) + r"\,"
            text = rf"\left({sympy.latex(size)}\right)" if size.is_Add else text
            sign_shown = ("-" if negative else "") if not shown else (" - " if negative else " + ")
            shown += f"{sign_shown}{text}{name}"
        return shown or "0"


def _size(components: list[Any]) -> int:
    return sum(len(sympy.Add.make_args(c)) for c in components if c != 0)


class Read:
    """A law's equations, called with symbols."""

    def __init__(self, law: Law) -> None:
        self.law = law
        self.matrices: list[tuple[Any, str]] = []
        self.scalars: list[Any] = []
        self.own: set[Any] = set()
        self.assumed: list[str] = []
        values = [self._gain(item) for item in law.fields()]
        self.gains = law.gains(*values)
        self.craft = Craft(INERTIA, INERTIA, sympy.Symbol(r"u_{\max}", positive=True), sympy.Symbol(r"\mu", positive=True))  # type: ignore[arg-type]
        zero = (sympy.Integer(0),) * 3
        self.measurement = Measurement((Q0, *Q), W, ABSOLUTE, zero, ACCELERATION, OUTSIDE, zero, PERIOD, MOMENTUM)  # type: ignore[arg-type]
        memory = law.remember(law.examples()[0], make_any_craft(), 0.1)
        if type(memory) is not NoMemory:
            names = dict(zip(memory._fields, "zv", strict=False))
            self.before = {name: vector(f"{letter}^{{0}}") for name, letter in names.items()}
            self.own |= {s for v in self.before.values() for s in v}
            memory = type(memory)(**self.before)
            self.letters = names
        self.memory = memory
        self.torque, self.after = law.command(self.measurement, self.gains, self.craft, memory)

    def _gain(self, item: Any) -> Any:
        if item.gain.choices or item.name == "boundary_layer":
            shown = item.gain.choices[item.default] if item.gain.choices else "0"
            self.assumed.append(f"`{item.name}` = `{shown}`")
            return item.default if item.gain.choices else 0
        if item.gain.shape == (3, 3):
            letter = sympy.latex(symbol(item.name)).replace("k_", "K_", 1) if item.name.startswith("k_") else "K"
            rows = matrix(letter.replace("_{", "^{"))
            self.own |= {s for row in rows for s in row}
            self.matrices.append((rows, letter))
            return rows
        one = symbol(item.name)
        self.scalars.append(one)
        if item.gain.shape == (3,):
            self.assumed.append(f"`{item.name}` the same on all axes")
            return (one, one, one)
        return one

    def candidates(self) -> list[tuple[Any, str]]:
        """Vectors that the torque may be a sum of, the longest first, for they hold terms of the shorter ones."""
        turned = add(scale(Q0, W), cross(Q, W))  # type: ignore[arg-type]
        known: list[tuple[Any, str]] = []
        signed: list[tuple[Any, str]] = []
        surface = getattr(self.law.module, "surface", None)
        if surface is not None or self.law.name == "super-twisting":
            (k, letter) = self.matrices[0]
            s = add(W, apply(k, Q))  # type: ignore[arg-type]
            signs: Any = tuple(sign(x) for x in s)
            signed.append((signs, r"\operatorname{sign} s"))
            for gain in self.scalars:
                root: Any = tuple(sqrt(gain * absolute(x)) * sign(x) for x in s)
                signed.append((root, rf"\sqrt{{{sympy.latex(gain)}\,|s|}}\,\operatorname{{sign}} s"))
            known.append((apply(INERTIA, apply(k, turned)), rf"J {letter} \left(q_0 \omega + q \times \omega\right)"))  # type: ignore[arg-type]
        known += [(apply(INERTIA, v), f"J {name}") for v, name in signed] + signed  # type: ignore[arg-type]
        for name, v in getattr(self, "before", {}).items():
            letter = self.letters[name]
            grown = add(v, scale(PERIOD, Q))  # type: ignore[arg-type]
            for limit in self.scalars:
                for over in self.scalars:
                    clipped: Any = tuple(clip(x, limit / over) for x in grown)
                    bound = sympy.latex(limit / over)
                    known.append((clipped, rf"\operatorname{{clip}}\left({letter}^0 + T q,\ {bound}\right)"))
            known += [(apply(INERTIA, v), f"J {letter}^0"), (v, f"{letter}^0")]  # type: ignore[arg-type]
        known += [(apply(k, v), f"{letter} {name}") for k, letter in self.matrices for v, name in ((W, r"\omega"), (Q, "q"))]  # type: ignore[arg-type]
        for v, name in ((W, r"\omega"), (ABSOLUTE, r"\Omega")):
            known.append((cross(v, apply(INERTIA, v)), rf"{name} \times J {name}"))  # type: ignore[arg-type]
        known += [
            (cross(ABSOLUTE, MOMENTUM), r"\Omega \times H"),  # type: ignore[arg-type]
            (apply(INERTIA, ACCELERATION), "J a"),  # type: ignore[arg-type]
            (times((Q0, Q0, Q0), Q), "q_0 q"),  # type: ignore[arg-type]
            (W, r"\omega"),
            (Q, "q"),
            (OUTSIDE, "M"),
        ]
        return known

    def formula(self, components: tuple[Any, ...], *more: tuple[Any, str]) -> Formula:
        """The components as a sum of vectors, as far as it is found."""
        found = Formula(components, self.own)
        for candidate, name in (*more, *self.candidates()):
            found.take(candidate, name)
        # As a law is written: feedback first.
        found.terms.sort(key=lambda term: ("times" in term[1], "J" in term[1], term[1] == "M", "q" in term[1]))
        return found


def make_any_craft() -> Craft:
    """Some craft, for what only its type counts of."""
    from starhold.parts.craft import make_craft

    return make_craft([2.0, 3.0, 4.0], 0.1)


def displayed(text: str) -> str:
    """A formula in a paragraph of its own."""
    return f"$$\n{text}\n$$"


def rigid_body(law: Law) -> list[str]:
    """Lines about the torque of a law of attitude control, and about its Lyapunov function."""
    if any(hasattr(law.module, name) for name in ("solve_plan", "Plan")) or law.name == "mpc":
        return ["The torque is the first move of a plan that is found by iterations, so that there is no formula of it.", ""]
    if getattr(law.module, "READS", ()):
        return [
            "The torque is that of rods in the measured field; the formula above is of their dipole and of what it gives.",
            "",
        ]
    if hasattr(law.module, "single_root"):
        return single_root(law)
    read = Read(law)
    if any(sympy.count_ops(c) > MOST_TO_SORT for c in read.torque):
        return components(law)
    kept = [(getattr(read.after, name), letter) for name, letter in getattr(read, "letters", {}).items()]
    turned = [(apply(INERTIA, v), f"J {letter}") for v, letter in kept]  # type: ignore[arg-type]
    torque = read.formula(read.torque, *turned, *kept)
    if not torque.found:
        return components(law)
    lines = [displayed(f"u = {torque.latex()}"), ""]
    for name in getattr(read, "before", {}):
        after = read.formula(getattr(read.after, name))
        if after.found:
            letter = read.letters[name]
            lines += [displayed(rf"{letter} = {after.latex()}"), ""]
    surface = getattr(law.module, "surface", None)
    if surface is not None or law.name == "super-twisting":
        lines += [displayed(rf"s = \omega + {read.matrices[0][1]} q"), ""]
    lines += potential(law, read, torque)
    if read.assumed:
        lines += [f"With {', '.join(read.assumed)}.", ""]
    return lines


def single_root(law: Law) -> list[str]:
    """Lines about the torque of a law that places one root a, where it does: by the vector p with p + q x p = w."""
    a, b = sympy.symbols(r"\lambda b", real=True)
    reciprocal = 1 / (1 + dot(Q, Q))  # type: ignore[arg-type]
    p = scale(reciprocal, add(add(W, cross(W, Q)), scale(dot(Q, W), Q)))  # type: ignore[arg-type]
    turned = dot(Q, W)  # type: ignore[arg-type]
    share = (4 * a * b - sympy.Rational(1, 2)) * turned - b * Q0 * dot(W, W) + (4 * a * a * b - 2 * a) * (Q0 - 1)  # type: ignore[arg-type]
    feedback = add(add(scale(2 * a * a, Q), scale(-2 * a, W)), scale(share, p))  # type: ignore[arg-type]
    model = add(cross(ABSOLUTE, add(apply(INERTIA, ABSOLUTE), MOMENTUM)), apply(INERTIA, ACCELERATION))  # type: ignore[arg-type]
    shown: Any = subtract(subtract(model, OUTSIDE), apply(INERTIA, feedback))  # type: ignore[arg-type]
    read = Read(law)
    torque, _ = law.command(read.measurement, law.gains((a, a, a), (a, a, a), b), read.craft, read.memory)
    if any(sympy.cancel(exact(u - v)) != 0 for u, v in zip(torque, shown, strict=True)):
        return components(law)
    return [
        displayed(
            r"u = \Omega \times J \Omega + \Omega \times H + J a - M"
            r" - J\left(2 \lambda^{2} q - 2 \lambda \omega + c p\right)"
        ),
        "",
        displayed(r"p = \frac{\omega - q \times \omega + \left(q \cdot \omega\right) q}{1 + |q|^{2}}"),
        "",
        displayed(
            r"c = \left(4 \lambda b - \tfrac{1}{2}\right) q \cdot \omega - b\, q_0 |\omega|^{2}"
            r" + \left(4 \lambda^{2} b - 2 \lambda\right) \left(q_0 - 1\right)"
        ),
        "",
        r"With `phi_0` = `phi_1` = $\lambda E$.",
        "",
    ]


def potential(law: Law, read: Read, torque: Formula) -> list[str]:
    """Lines about V and, with its derivative along the motion to a target at rest, how it falls."""
    if law.lyapunov is None:
        return []
    if read.matrices:
        told = " ".join((law.lyapunov.__doc__ or "").split()).removeprefix("Return ")
        return [told.replace("*", "\\*"), ""]
    value = exact(law.lyapunov(read.measurement, read.gains, read.craft))
    found = Formula((value,), read.own | {Q0})
    for candidate, name in (
        (dot(W, apply(INERTIA, W)), r"\omega \cdot J \omega"),  # type: ignore[arg-type]
        (dot(Q, Q), r"|q|^2"),  # type: ignore[arg-type]
        (1 - Q0, r"\left(1 - q_0\right)"),
    ):
        found.take((candidate,), name)
    if not found.found:
        return []
    # At a target at rest, without wheels; J w' = u + M - w x Jw, and dV/dw = Jw, so that the inverse of J goes.
    rest = dict(zip((*ABSOLUTE, *ACCELERATION, *MOMENTUM), (*W, *(0,) * 6), strict=True))
    u = [exact(c).subs(rest) for c in read.torque]
    gyroscopic = cross(W, apply(INERTIA, W))  # type: ignore[arg-type]
    power = sum(w * (t + m - g) for w, t, m, g in zip(W, u, OUTSIDE, gyroscopic, strict=True))
    turning = [-dot(Q, W) / 2, *(c / 2 for c in add(scale(Q0, W), cross(Q, W)))]  # type: ignore[arg-type,operator]
    slopes = sum(sympy.diff(value, x) * rate for x, rate in zip((Q0, *Q), turning, strict=True))
    fall = Formula((sympy.expand(power + slopes),), read.own)
    for candidate, name in ((dot(W, W), r"|\omega|^2"), (dot(W, OUTSIDE), r"\omega \cdot M")):  # type: ignore[arg-type]
        fall.take((candidate,), name)
    lines = [displayed(f"V = {found.latex()}"), ""]
    if fall.found:
        lines += [displayed(rf"\dot V = {fall.latex()}"), ""]
    return lines


def components(law: Law) -> list[str]:
    """Lines about a law whose torque is no sum of a few vectors: its components, with what they share named, about
    principal axes and for a target at rest."""
    moments = vector("J")
    gains = [_plain(item) for item in law.fields()]
    zero = (sympy.Integer(0),) * 3
    measurement = Measurement((Q0, *Q), W, W, zero, zero, OUTSIDE, zero, PERIOD)  # type: ignore[arg-type]
    craft = Craft(moments, tuple(1 / m for m in moments), sympy.Symbol(r"u_{\max}"), sympy.Symbol(r"\mu"))  # type: ignore[arg-type]
    torque, _ = law.command(measurement, law.gains(*gains), craft, NoMemory())
    return [
        "About principal axes, for a target at rest, with each matrix a multiple of the identity:",
        "",
        *_shared(torque, "u"),
    ]


def _plain(item: Any) -> Any:
    if item.gain.choices:
        return item.default
    one = symbol(item.name)
    return (one, one, one) if item.gain.shape else one


def _settled(value: Any) -> Any:
    """An expression by cases without the conditions that hold already where they stand."""

    def plain(condition: Any, yes: Any, no: Any) -> Any:
        return sympy.Or(sympy.And(condition, yes), sympy.And(sympy.Not(condition), no))

    def cases(*pairs: Any) -> Any:
        return sympy.Piecewise(*((case.xreplace({condition: sympy.true}), condition) for case, condition in pairs))

    return sympy.sympify(value).replace(sympy.ITE, plain).replace(sympy.Piecewise, cases)


def _shared(values: tuple[Any, ...], letter: str) -> list[str]:
    """The components of a vector, with what they share named; or how long they are."""
    shared, reduced = sympy.cse(
        [exact(_settled(v)) for v in values], symbols=(sympy.Symbol(f"c_{{{n}}}") for n in range(1, 1000))
    )
    if sum(sympy.count_ops(v) for _, v in shared) + sum(map(sympy.count_ops, reduced)) > MOST_OPERATIONS:
        count = sum(sympy.count_ops(v) for _, v in shared) + sum(map(sympy.count_ops, reduced))
        return [f"The components take {count} operations, with what they share named; they are not printed here.", ""]
    lines = [f"{sympy.latex(name)} &= {sympy.latex(value)}" for name, value in shared]
    lines += [f"{letter}_{{{axis}}} &= {sympy.latex(value)}" for axis, value in zip("xyz", reduced, strict=True)]
    return [displayed("\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"), ""]


def station(law: Law) -> list[str]:
    """Lines about the control of a law near a libration point, and its Lyapunov function, in scaled units."""
    turning, stiffness = sympy.Integer(1), sympy.Symbol("C", positive=True)
    plant = Libration(turning, stiffness, *sympy.symbols("d_1 d_2 g_1 g_2", real=True))  # type: ignore[arg-type]
    measurement = PointMeasurement(R, V, PERIOD, sympy.Symbol(r"u_{\max}", positive=True))  # type: ignore[arg-type]
    values = [_scaled(item) for item in law.fields()]
    gains = law.gains(*values)
    control, _ = law.command(measurement, gains, plant, NoMemory())
    lines = _shared(control, "u")
    if law.lyapunov is not None:
        value = exact(law.lyapunov(measurement, gains, plant))
        lines += [displayed(f"V = {sympy.latex(value)}"), ""]
    assumed = [f"`{i.name}` = `{i.gain.choices[i.default]}`" for i in law.fields() if i.gain.choices and not i.required]
    assumed += ["`boundary_layer` = `0`"] * any(i.name == "boundary_layer" for i in law.fields())
    return [*lines, f"With {', '.join(assumed)}.", ""] if assumed else lines


def _scaled(item: Any) -> Any:
    if item.gain.choices or item.name == "boundary_layer":
        return item.default if item.gain.choices and not item.required else 0
    if item.gain.shape == (3,):
        return vector(sympy.latex(symbol(item.name)).replace("_{", "^{"))
    return symbol(item.name)
