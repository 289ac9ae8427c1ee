"""A system and claims about it, from a TOML file or from Python, and their common certificate."""

import json
import keyword
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from importlib import resources
from pathlib import Path
from typing import Any, cast

from starhold.algebra.polynomial import Polynomial, exact, pieces
from starhold.certification.certificate import Certificate
from starhold.certification.evidence.finding import certificate as kernel_certificate
from starhold.certification.invariant.system import TURNED, System, check_sizes, turned
from starhold.certification.invariant.text import MOST_DIGITS, RESERVED, ExpressionError, as_written, read
from starhold.certification.invariant.theorems import ATTRACTING, THEOREMS, Shown, WantedSet, a_state, indicator, show
from starhold.errors import InputError, closest, expect
from starhold.files import read_text

MOVING, MOST, LARGEST, LONGEST = 7, 9, 1e100, 100
"""The most variables, and with parameters, for which evidence can be found; the largest number of a box, whose powers floats
can hold; the most characters of a name."""
_KEYS = ("name", "description", "variables", "parameters", "define", "rates", "box", "claim")
_NUMBERS = ("level", "known", "published")
_CLAIM = ("name", "theorem", "V", "box", "equilibrium", "escape", "squares", "core", "start", "unsafe", "orbit", *_NUMBERS)


@dataclass(frozen=True)
class InvariantProblem:
    """A system with the claims to be shown. `written`: the system's description in the certificate; `orbits`: for each claim
    a state whose motion backwards in time goes to the border of the true region, or None."""

    name: str
    system: System
    claims: tuple[WantedSet, ...]
    description: str = ""
    written: dict[str, Any] = field(default_factory=dict[str, Any])
    orbits: tuple[tuple[float, ...] | None, ...] = ()

    def orbit(self, place: int) -> tuple[float, ...] | None:
        """The state on the border of the true region that a claim comes with."""
        return self.orbits[place] if place < len(self.orbits) else None


@dataclass(frozen=True, repr=False)
class SetCertificate(Certificate):
    """Claims about invariant sets; `shown` has those that are proved or refuted as the kernel reads them."""

    shown: tuple[Shown, ...] = ()


def certify(problem: InvariantProblem) -> SetCertificate:
    """Prove each claim of a problem as far as possible."""
    system = problem.system
    rates = zip(system.variables, system.rates, strict=True)
    written = problem.written or {"rates": {name: [str(piece.value) for piece in pieces(rate)] for name, rate in rates}}
    subject = {"variables": list(system.variables), "parameters": list(system.parameters), **written}
    shown = tuple(show(system, wanted) for wanted in problem.claims)
    return SetCertificate(problem.name, subject, tuple(one.claim for one in shown), shown=shown)


def write(certificate: SetCertificate, path: Path) -> None:
    """Write what is proved or refuted as the kernel reads it."""
    proofs = [one for one in certificate.shown if one.kernel is not None]
    programs = [program for one in proofs for program in one.programs]
    content = kernel_certificate(programs, [one.kernel for one in proofs if one.kernel is not None])
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def builtin_names() -> list[str]:
    """Return the names of the built-in problems."""
    folder = resources.files("starhold.certification.invariant") / "builtin"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load(source: str | Path) -> InvariantProblem:
    """Read the problem in a file, or the built-in one of that name. InputError states its first error."""
    expect(source, (str, Path), "invariant", "a problem, or the name of a file or of a built-in problem")
    path = Path(source)
    if not path.exists() and str(source) in builtin_names():
        file = resources.files("starhold.certification.invariant") / "builtin" / f"{source}.toml"
        return parse(file.read_text(encoding="utf-8"), str(source))
    try:
        text = read_text(path)
    except FileNotFoundError:
        known = closest(str(source), builtin_names())
        raise InputError(str(source), "", "no such file", f"a file with a system, or a built-in one: {known}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise InputError(str(source), "", "", f"cannot be read: {reason}") from None
    return parse(text, str(source))


def parse(text: str, where: str) -> InvariantProblem:
    """The problem of a TOML text; `where` names it in errors."""
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # Also of whole numbers of too many digits, and of lists too deep in one another.
        raise InputError(where, "", "", f"not TOML: {error}") from None
    return _File(where, data).problem()


class _File:
    """Reads the tables of one file."""

    def __init__(self, where: str, data: dict[str, Any]) -> None:
        self.where, self.data = where, data
        self.names: dict[str, Any] = {}
        self.variables: tuple[str, ...] = ()
        self.parameters: dict[str, tuple[float, float]] = {}

    def problem(self) -> InvariantProblem:
        """All of it."""
        self._known(self.data, _KEYS, "")
        self._variables()
        for name, value in self._table(self.data.get("define", {}), "define").items():
            self._fresh(name, f"define.{name}")
            self.names[name] = self._expression(value, f"define.{name}")
        rates = self._table(self._required(self.data, "rates", ""), "rates")
        self._exactly(rates, self.variables, "rates")
        read_rates = tuple(self._expression(rates[name], f"rates.{name}") for name in self.variables)
        claims = self._required(self.data, "claim", "")
        if not isinstance(claims, list) or not claims:
            raise InputError(self.where, "claim", _show(claims), "at least one [[claim]] table")
        tables = [self._table(item, f"claim[{k}]") for k, item in enumerate(cast(list[Any], claims), 1)]
        wanted = [self._claim(table, f"claim[{k}]") for k, table in enumerate(tables, 1)]
        functions = [f for item, _ in wanted for f in (indicator(item), item.core or 0, *item.start, *item.unsafe)]
        named = {x for value in (*read_rates, *functions) for x in _names(value)}
        angles = (x for x in self.variables if named.intersection(turned(f, x) for f in TURNED))
        system = System(self.variables, read_rates, tuple(self.parameters), tuple(angles))
        for k, (item, _) in enumerate(wanted, 1):
            self._fits(system, item, f"claim[{k}]")
        written: dict[str, Any] = {name: self.data[name] for name in ("define", "rates") if name in self.data}
        written["V"] = [table["V"] for table in tables]
        # All inputs of a claim, so that it can be checked from the certificate alone.
        points = [item[0].equilibrium for item in wanted]
        if any(point is not None for point in points):
            names = self.variables
            written["equilibrium"] = [at and {n: str(x) for n, x in zip(names, at, strict=True)} for at in points]
        for key in ("escape", "squares", "core", "start", "unsafe"):
            if any(key in table for table in tables):
                written[key] = [table.get(key) for table in tables]
        return InvariantProblem(
            self._text(self.data, "name", "", Path(self.where).stem),
            system,
            tuple(item[0] for item in wanted),
            self._text(self.data, "description", "", ""),
            written,
            tuple(item[1] for item in wanted),
        )

    def _variables(self) -> None:
        names = self._required(self.data, "variables", "")
        allowed = f"a list of 1 to {MOVING} names"
        if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in cast(list[Any], names)):
            raise InputError(self.where, "variables", _show(names), allowed)
        parameters = self._table(self.data.get("parameters", {}), "parameters")
        for name in (*cast(list[str], names), *parameters):
            self._fresh(name, "parameters" if name in parameters else "variables")
            self.names[name] = Polynomial.variable(name)
        self.variables = tuple(cast(list[str], names))
        for count, most, what in ((len(self.variables), MOVING, "variables"), (len(self.names), MOST, "with parameters")):
            if count > most:
                raise InputError(self.where, "variables", f"{count} {what}", f"at most {most}")
        self.names |= {turn: Polynomial.variable(turn) for x in self.variables for turn in (turned(f, x) for f in TURNED)}
        self.parameters = {name: self._interval(value, f"parameters.{name}") for name, value in parameters.items()}

    def _claim(self, table: dict[str, Any], key: str) -> tuple[WantedSet, tuple[float, ...] | None]:
        if "rest" in table:
            raise InputError(self.where, f"{key}.rest", "an unknown key", "the key is named equilibrium")
        self._known(table, _CLAIM, key)
        theorem = self._required(table, "theorem", key)
        if theorem not in THEOREMS:
            raise InputError(self.where, f"{key}.theorem", _show(theorem), closest(str(theorem), THEOREMS))
        V = self._indicator(self._required(table, "V", key), theorem, f"{key}.V")
        at = self._state(table["equilibrium"], f"{key}.equilibrium") if "equilibrium" in table else None
        escape = self._polynomial(table["escape"], f"{key}.escape") if "escape" in table else None
        squares = self._polynomials(table.get("squares", []), f"{key}.squares")
        core = self._expression(table["core"], f"{key}.core") if "core" in table else None
        if core is not None and theorem not in ATTRACTING:
            raise InputError(self.where, f"{key}.core", f'a core with theorem "{theorem}"', "theorem attracts or region")
        sets = dict[str, tuple[Any, ...]]()
        for name, others in (("start", ATTRACTING), ("unsafe", ())):
            if theorem == "avoids":
                self._required(table, name, key)
            elif name in table and theorem not in others:
                allowed = ", ".join(("avoids", *others))
                raise InputError(self.where, f"{key}.{name}", f'a set with theorem "{theorem}"', f"theorem {allowed}")
            sets[name] = self._polynomials(table.get(name, []), f"{key}.{name}")
        if sets["start"] and theorem != "avoids" and "level" not in table:
            raise InputError(self.where, f"{key}.level", "nothing", "a level of V that the start set is shown to be below")
        if theorem == "avoids" and at is not None:
            raise InputError(self.where, f"{key}.equilibrium", "a point", "a start and an unsafe set alone")
        numbers = {name: self._positive(table, name, key) for name in _NUMBERS}
        orbit = tuple(float(x) for x in self._state(table["orbit"], f"{key}.orbit")) if "orbit" in table else None
        exactly = None if at is None else tuple(exact(x) for x in at)
        name = self._text(table, "name", key, "")
        more: dict[str, Any] = {"escape": escape, "squares": squares, "core": core, **numbers, **sets}
        return WantedSet(theorem, V, self._box(table, key), exactly, name=name, **more), orbit

    def _fits(self, system: System, wanted: WantedSet, key: str) -> None:
        if system.angles and wanted.theorem in ("unstable", "avoids"):
            described = f'"{wanted.theorem}" of a system with sin or cos'
            raise InputError(self.where, f"{key}.theorem", described, "another theorem")
        for name, given in (("core", wanted.core is not None), ("start", bool(wanted.start))):
            if system.angles and given:
                raise InputError(self.where, f"{key}.{name}", f"a {name} of a system with sin or cos", "V alone")
        if system.angles and wanted.equilibrium is None:
            raise InputError(self.where, f"{key}.equilibrium", "nothing", "an equilibrium, as the system has sin or cos")
        for x in system.angles:
            if wanted.equilibrium and wanted.equilibrium[system.variables.index(x)]:
                raise InputError(self.where, f"{key}.equilibrium.{x}", "an angle at an equilibrium", "zero")
        try:
            for V in (indicator(wanted), wanted.core):
                check_sizes(system, 0 if V is None else V)
        except ValueError as error:
            raise InputError(self.where, f"{key}.V", str(error), "fewer comparisons, or lower powers") from None
        for name in ("start", "unsafe") if wanted.theorem == "avoids" else ("start",) * bool(wanted.start):
            try:
                a_state(system, wanted, getattr(wanted, name))
            except ValueError as error:
                raise InputError(self.where, f"{key}.{name}", str(error), "one that holds a state of the box") from None

    def _indicator(self, value: Any, theorem: str, key: str) -> Any:
        if theorem != "intersection":
            return self._expression(value, key)
        if not value:
            raise InputError(self.where, key, _show(value), "a list of expressions")
        return tuple(self._expression(v, f"{key}[{k}]") for k, v in enumerate(self._list(value, key), 1))

    def _list(self, value: Any, key: str) -> list[Any]:
        if not isinstance(value, list):
            raise InputError(self.where, key, _show(value), "a list of expressions")
        return cast(list[Any], value)

    def _polynomials(self, value: Any, key: str) -> tuple[Any, ...]:
        return tuple(self._polynomial(h, f"{key}[{k}]") for k, h in enumerate(self._list(value, key), 1))

    def _polynomial(self, value: Any, key: str) -> Any:
        expression = self._expression(value, key)
        if len(pieces(expression)) > 1:
            raise InputError(self.where, key, "a piecewise function", "one polynomial")
        return expression

    def _box(self, table: dict[str, Any], key: str) -> tuple[tuple[float, float], ...]:
        place = f"{key}.box" if "box" in table else "box"
        box = self._table(table["box"] if "box" in table else self._required(self.data, "box", ""), place)
        self._exactly(box, self.variables, place)
        sides = [self._interval(box[name], f"{place}.{name}") for name in self.variables]
        return (*sides, *self.parameters.values())

    def _state(self, value: Any, key: str) -> tuple[Fraction, ...]:
        table = self._table(value, key)
        self._exactly(table, self.variables, key)
        coordinates: list[Fraction] = []
        for name in self.variables:
            x = table[name]
            try:
                if isinstance(x, bool):
                    raise ValueError
                # As written: 0.1 is one tenth, and a text may be a fraction.
                coordinates.append(as_written(str(x)))
            except (ValueError, ZeroDivisionError):
                raise InputError(self.where, f"{key}.{name}", _show(x), 'a number, or a fraction such as "1/3"') from None
        return tuple(coordinates)

    def _interval(self, value: Any, key: str) -> tuple[float, float]:
        ends = cast(list[Any], value) if isinstance(value, list) else []
        if len(ends) == 2 and all(type(x) in (int, float) and abs(x) <= LARGEST for x in ends) and ends[0] < ends[1]:
            return float(ends[0]), float(ends[1])
        raise InputError(self.where, key, _show(value), f"two numbers [low, high], low < high, within {LARGEST:g}")

    def _positive(self, table: dict[str, Any], name: str, key: str) -> float | None:
        value = table.get(name)
        if value is None or (type(value) in (int, float) and 0.0 < value <= LARGEST):
            return None if value is None else float(value)
        raise InputError(self.where, f"{key}.{name}", _show(value), f"a positive number, at most {LARGEST:g}")

    def _expression(self, value: Any, key: str) -> Any:
        if isinstance(value, bool) or not isinstance(value, (str, int, float)):
            raise InputError(self.where, key, _show(value), "an expression in quotes")
        try:
            return read(_written(value), self.names)
        except ExpressionError as error:
            raise InputError(self.where, key, error.written, error.allowed) from None

    def _fresh(self, name: str, key: str) -> None:
        if not name.isidentifier() or keyword.iskeyword(name) or name in RESERVED:
            raise InputError(self.where, key, _show(name), "a name of letters, digits and _ that is not a function")
        if name in self.names:
            raise InputError(self.where, key, _show(name), "a name that is not taken")

    def _exactly(self, table: dict[str, Any], names: Sequence[str], key: str) -> None:
        self._known(table, names, key)
        for name in names:
            self._required(table, name, key)

    def _known(self, table: dict[str, Any], names: Sequence[str], key: str) -> None:
        for name in table:
            if name not in names:
                raise InputError(self.where, f"{key}.{name}".lstrip("."), "an unknown key", closest(name, names))

    def _required(self, table: dict[str, Any], name: str, key: str) -> Any:
        if name not in table:
            raise InputError(self.where, f"{key}.{name}".lstrip("."), "nothing", "this key is required")
        return table[name]

    def _table(self, value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise InputError(self.where, key, _show(value), f"a table, one line for each of {', '.join(self.variables)}")
        return cast(dict[str, Any], value)

    def _text(self, table: dict[str, Any], name: str, key: str, default: str) -> str:
        value = table.get(name, default)
        if not isinstance(value, str) or (name == "name" and (len(value) > LONGEST or not (key or _file_name(value)))):
            allowed = f"at most {LONGEST} characters" + ("" if key else ": letters, digits, '-', '_', '.' and spaces")
            raise InputError(self.where, f"{key}.{name}".lstrip("."), _show(value), allowed)
        return value


def _names(value: Any) -> set[str]:
    """The names that a piecewise polynomial depends on."""
    every = (part for case in pieces(value) for part in (case.value, *(c.positive for c, _ in case.truths)))
    return {name for part in every for name in part.variables()}


def _file_name(text: str) -> bool:
    return bool(text) and all(c.isalnum() or c in "-_. " for c in text) and not text.startswith(".")


def _written(value: Any) -> str:
    try:
        return str(value)
    except ValueError:
        raise ExpressionError("a number that is too long", f"at most {MOST_DIGITS} digits") from None


def _show(value: Any) -> str:
    try:
        text = f'"{value}"' if isinstance(value, str) else str(value)
    except (ValueError, RecursionError):
        text = "what is too long to show"
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
