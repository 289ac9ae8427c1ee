"""What a system and V are on a surface alone counts: in proofs, and against motions of random systems."""

from fractions import Fraction

import numpy as np
import pytest

from starhold.certification.invariant import certify, parse, write
from starhold.certification.invariant.search import Candidate
from starhold.checker import check_file, passed
from tests.certification.invariants import ORIGIN as AT_ORIGIN
from tests.certification.invariants import SQUARE, claim, expression, file, fractions, system
from tests.tiers import drawn, leading

ORIGIN, ROUND = (0, 0), "x**2 + y**2"
ON = (
    "(1 if {0} <= 0 and {0} >= 0 else 0)",
    "(1 if {0} <= 0 <= {0} else 0)",
    "(1 if not ({0} < 0 or 0 < {0}) else 0)",
    "(1 - abs(sign({0})))",
    "(1 - sign({0})**2)",
    "where(2*({0}) <= 0, where(-3*({0}) <= 0, 1, 0), 0)",
    "(1 if ({0})**2 <= 0 else 0)",
    "(1 if abs({0}) <= 0 else 0)",
    "(1 if max({0}, -({0})) <= 0 else 0)",
)
"""Texts for what is 1 where something is zero, else 0."""


def written(folder, x="-x", y="-y", V=ROUND, theorem="region", equilibrium=AT_ORIGIN):
    """A certificate, and what the kernel says of its file."""
    found = certify(parse(file(x, y, f'"{V}"', theorem, equilibrium, half=1.5), "mine.toml"))
    write(found, folder / "c.json")
    return found, check_file(folder / "c.json")


@pytest.mark.parametrize(
    ("on", "surface"),
    # Each text on one surface, and others.
    drawn([(on, ("x", "x - y", "y - x**2")[(k + more) % 3]) for more in range(3) for k, on in enumerate(ON)], 6, len(ON)),
)
def test_a_function_that_is_another_on_a_surface_is_not_continuous(on, surface, tmp_path):
    V = f"{ROUND} - 5*{on.format(surface)}"
    found, said = written(tmp_path, V=V)
    assert found.outcome != "proved"
    if surface != "y - x**2" and ")**2 <= 0" not in on:
        s = fractions(found.claims[0].refutation().evidence["state"])
        assert eval(surface, dict(s)) == 0
        assert passed(said)
        assert "V jumps at a state" in said[0].obligation


@pytest.mark.slow
@pytest.mark.parametrize("on", leading(ON))
def test_rates_that_are_others_on_a_surface_count(on, tmp_path):
    """(0, y) stays on x = 0 and grows there."""
    y = f"-y + 5*y*{on.format('x')}"
    found, _ = written(tmp_path, y=y)
    assert found.outcome != "proved"


@pytest.mark.parametrize(
    ("x", "y", "V"),
    leading(
        [
            ("-x*sign(x)**2", "-y", ROUND),
            ("-x", "-y", "max(x, -x)*abs(x) + y*sign(y)*abs(y)"),
            ("-x - x*(1 - abs(sign(x)))", "-y", ROUND),
            ("-x", "-y - 3*(1 - abs(sign(x)))*y", ROUND),
            ("-x - sign(x)/4", "-y", ROUND),
            ("-x*sign(x)**2", "-y", f"{ROUND} + x*(1 - abs(sign(x)))"),
        ],
        3,
    ),
)
def test_what_is_no_worse_on_a_surface_is_proved(x, y, V, tmp_path):
    found, said = written(tmp_path, x, y, V)
    assert found.outcome == "proved"
    assert passed(said)


def test_an_equilibrium_may_be_one_on_its_surface_only():
    assert claim(("-sign(x) - x", "-y"), "region", ROUND, equilibrium=ORIGIN).outcome == "proved"


def test_rates_on_a_surface_count_where_it_is_crossed():
    """From both sides to the right; on it, to the left, upward, where V rises."""
    through, box = ("1", "0"), ((-1.0, 1.0), (-1.0, 1.0))
    against = ("1 - 2*(1 if x <= 0 <= x else 0)", "(1 if x <= 0 <= x else 0)")
    for rates in (through, against):
        assert claim(rates, "region", "3 - x + y", box, level=0.5).outcome != "proved"


def test_every_state_is_in_a_cell_that_is_what_the_text_says():
    """Also states of surfaces, and where several meet."""
    V = "sign(x)*2 + sign(y)*3 + sign(x - y)*5 + (7 if x <= 0 and x >= 0 and y <= 0 and y >= 0 else 0)"
    what = Candidate(system(("-x", "-y")), expression(V), SQUARE)
    for state in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]:
        x, y = (Fraction(n) for n in state)
        sign = lambda n: (n > 0) - (n < 0)  # noqa: E731
        wanted = Fraction(eval(V, {"sign": sign, "x": x, "y": y}))
        assert wanted in [what.at(cell.function, (x, y)) for cell in what.near((x, y))]


# --- random systems against motions -------------------------------------------------------------------------------------

LINES = ("x", "y", "x - y", "x + y", "x + 1/2", "y - 1/2", "x**2 + y**2 - 1", "x - y**2")
THICK = (
    "sat(2*x)",
    "abs(x)/2",
    "sign(x)/4",
    "sign({0})*x/4",
    "(x if {0} > 0 else x/2)",
    "sign({0})*sign({1})*y/8",
    "sat({0})*x",
)
FORMS = (ROUND, "2*x**2 + x*y + y**2", "x**2 + 2*y**2 - 1/4", "max(x**2 + y**2 - 1/4, 0)", "x**2 + y**2 + max(x, 0)*x")
PYTHON = {"abs": abs, "max": max, "min": min, "sign": lambda n: int(n > 0) - int(n < 0), "sat": lambda n: max(-1, min(1, n))}
PYTHON["where"] = lambda c, a, b: a if c else b


def made(random):
    """Rates, V, theorem and equilibrium, with something thin in one of them."""

    def one(texts):
        return texts[random.integers(len(texts))]

    line = one(LINES)
    thin = f"{random.integers(-4, 5)}*{one(('x', 'y', '1', 'abs(x)', f'({line})'))}*{one(ON).format(line)}"
    turn = random.integers(-2, 3) / 2
    rates = [f"{turn}*y - {random.integers(1, 4)}*x", f"{-turn}*x - {random.integers(1, 4)}*y"]
    V, place = one(FORMS), random.integers(3)
    rates[random.integers(2)] += f" - {one(THICK).format(one(LINES), one(LINES))}" if random.random() < 0.6 else ""
    if place == 2:
        V += f" + {thin}"
    else:
        rates[place] += f" + {thin}"
    theorem = one(("region", "stable", "attracts", "unstable"))
    if theorem == "unstable":
        rates = [f"-({rate})" for rate in rates]
    return rates, V, theorem, "equilibrium = { x = 0, y = 0 }" if random.random() < 0.6 else ""


def on_lines(random):
    """Exact states, most of them on the lines where something may be thin."""
    found = [tuple(Fraction(int(n), 100) for n in random.integers(-150, 151, size=2)) for _ in range(30)]
    for n in (Fraction(int(n), 100) for n in random.integers(-150, 151, size=8)):
        found += [(Fraction(0), n), (n, Fraction(0)), (n, n), (n, -n), (Fraction(-1, 2), n), (n, Fraction(1, 2)), (n * n, n)]
    return [*found, (Fraction(3, 5), Fraction(4, 5)), (Fraction(5, 13), Fraction(-12, 13)), (Fraction(-1), Fraction(0))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", drawn([1, 2, 4, 6, 0, 3, 5, *range(7, 14), 15, 16, *range(18, 24)], 8, 2))
def test_what_is_proved_holds_on_surfaces_too(seed, tmp_path):
    """By exact values of the texts, and by motions that keep to a line while the rates there point along it."""
    random = np.random.default_rng(seed)
    rates, V, theorem, equilibrium = made(random)
    found, said = written(tmp_path, *rates, V, theorem, equilibrium)
    assert passed(said) or said[0].reason == "there are no claims, or too many"
    codes = [compile(text, "text", "eval") for text in (*rates, V)]

    def at(x, y):
        return [eval(code, PYTHON, {"x": x, "y": y}) for code in codes]

    level, sense = found.claims[0].numbers.get("level", 1e9), -1 if theorem == "unstable" else 1
    for x, y in on_lines(random) if found.outcome == "proved" else []:
        u, v, value = at(x, y)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            near = at(x + dx * Fraction(1, 10**9), y + dy * Fraction(1, 10**9))[2]
            assert abs(near - value) < Fraction(1, 10**6)
        if not 0 < value <= level or (u, v) == (0, 0):
            continue
        step = Fraction(1, 10**6)
        after = at(x + step * u, y + step * v)
        if u * after[1] == v * after[0]:
            assert sense * (after[2] - value) / step < Fraction(1, 10**3)
