"""The mutation run changes what it says it changes."""

from pathlib import Path

from tests.mutation import ROOT, mutants, nearest

SOURCE = '''"""Ω stands before what is changed, as two bytes."""
CARD = Card(1 + 2)
def examples() -> Annotated[float, 3]:
    return [4.0]
def f(a: Annotated[float, 5], b):
    if a:
        raise Wrong(f"{a - 1}")
    return g(a, 6)
x = 7.0 - y
z = u if less(u, v) else where(u < v, s, t)
'''


def test_each_mutant_is_the_source_with_one_change():
    made = [
        (one, SOURCE.encode()[: one.start].decode(), SOURCE.encode()[one.end :].decode()) for one in mutants(SOURCE.encode())
    ]
    changed = {(one.operator, SOURCE[len(before) : len(SOURCE) - len(after)], one.after) for one, before, after in made}
    assert changed == {
        ("condition", "a", "(not a)"),
        ("first argument", "g(a, 6)", "(a)"),
        ("arguments", "g(a, 6)", "(g(6, a))"),
        ("constant", "6", "(7)"),
        ("sign", "7.0 - y", "(7.0 + y)"),
        ("term", "7.0 - y", "(7.0)"),
        ("constant", "7.0", "(14.0)"),
        ("branches", "u if less(u, v) else where(u < v, s, t)", "(where(u < v, s, t) if less(u, v) else u)"),
        ("order", "less(u, v)", "(less_equal(u, v))"),
        ("branches", "where(u < v, s, t)", "(where(u < v, t, s))"),
        ("order", "u < v", "(u <= v)"),
    }
    assert len(made) == len(changed)


def test_nearest_tests_are_those_of_the_module():
    near = nearest(ROOT, Path("starhold/parts/effectors/wheels.py"))
    assert near[0] == "tests/parts/test_wheels.py"
    assert "tests/wheels/test_limits.py" in near
    assert "tests/certification/test_checker_files.py" in nearest(ROOT, Path("starhold/checker/well.py"))
