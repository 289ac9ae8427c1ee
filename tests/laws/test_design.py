"""`sh.design` and `starhold design` tell the same."""

import numpy as np
import pytest

import starhold as sh
from starhold.laws import lqr
from starhold.scenario.reading import builtin_text
from tests.refusals import complains, refused
from tests.running import starhold
from tests.texts import toml

TEXT = builtin_text("three-laws").split("[[law]]")[0] + toml("""
[[law]] type = "lqr"; form = "II"; q = [1, 1, 1, 0.2, 0.3, 0.2]; r = 50; balance = "q5"

[[law]] type = "pd"; k_rate = 0.1; k_attitude = 0.01

[[law]] type = "matrix-pd"; name = "classical"; form = "inertial"; a = 0; b = 100; d = 0.1
""")


@pytest.fixture
def file(tmp_path):
    (tmp_path / "my.toml").write_text(TEXT)
    return tmp_path / "my.toml"


def test_every_law_with_a_form_is_designed(file):
    first, second = sh.design(file)
    assert (first.name, first.law, first.form) == ("lqr", "lqr", "II")
    assert first.inputs == {"q": (1.0, 1.0, 1.0, 0.2, 0.3, 0.2), "r": (50.0,) * 3, "balance": "q5"}
    # 2 y1 y3 / (y3 + y1) is the balanced y2; y1 = y3 here.
    assert first.gains["k_attitude"] == pytest.approx([0.004**0.5] * 3, rel=1e-14)
    assert first.gains["gyroscopic"] == 0.0
    assert first.figures["P"].shape == (6, 6)
    assert first.figures["P against SciPy, relative"] < 1e-12
    assert first.figures["of the weights q given"][4] == pytest.approx(2 / 3)
    assert (second.name, second.law, second.form) == ("classical", "matrix-pd", "inertial")
    assert second.gains == {"k_rate": pytest.approx([0.2, 0.3, 0.4]), "k_attitude": pytest.approx([0.01] * 3)}
    assert second.figures == {}


def test_one_law_is_picked_from_a_scenario_or_a_path(file):
    for source in (file, str(file), sh.load(file)):
        assert [found.name for found in sh.design(source, law="classical")] == ["classical"]


@pytest.mark.parametrize(
    ("law", "said"), [("pd", "my.toml: law pd: found no form"), ("clasical", "did you mean classical?")]
)
def test_what_cannot_be_designed_is_one_line(file, law, said):
    with refused(said):
        sh.design(file, law=law)
    with pytest.raises(sh.InputError, match="no form"):
        sh.design("three-laws")


def test_figures_that_overflow_are_one_line(file, monkeypatch):
    def overflow(craft, spec):
        raise ValueError("the numbers leave the range of floats")

    monkeypatch.setattr(lqr, "explain", overflow)
    with pytest.raises(sh.InputError, match="law lqr: figures cannot be computed"):
        sh.design(file)


def test_the_command_prints_what_the_function_returns(file):
    def told(*words):
        return starhold("design", file.name, *words, cwd=file.parent)

    done = told()
    assert done.returncode == 0, done.stderr
    for found in sh.design(file):
        assert f"{found.name}: " in done.stdout
        for name, value in (found.inputs | found.gains).items():
            assert name in done.stdout
            for number in np.ravel(value):
                assert (number if isinstance(number, str) else f"{number:.6g}") in done.stdout
        for name, value in found.figures.items():
            assert name in done.stdout
            texts = [f"{name}: {value:.3g}"] if isinstance(value, float) else [f"{number:.6g}" for number in np.ravel(value)]
            assert all(text in done.stdout for text in texts)
    complains(told("--map", "map.xyz"), "--map: found map.xyz; allowed: the name of a PNG file")
    one = told("--law", "classical")
    assert "classical: " in one.stdout
    assert "lqr: " not in one.stdout
    assert told("--law", "pd").returncode == 2
