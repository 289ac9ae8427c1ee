"""Draws against the distributions of SciPy, and what is refused."""

import math
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from starhold.errors import InputError
from starhold.scenario import distribution
from starhold.scenario.distribution import DISTRIBUTIONS, Spread
from starhold.scenario.quantity import raw
from starhold.scenario.reading import load
from tests.campaign.flown import dispersed, normal, uniform
from tests.refusals import refused

NOISE = load("three-laws-noise")
FULL = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]]
EVEN = (np.arange(4000) + 0.5)[None, :] / 4000.0
UNIFORM = st.floats(1e-12, 1.0 - 1e-12)
REAL = st.floats(-1e3, 1e3)
WIDTH = st.floats(1e-3, 1e3)


def one(scenario, **over):
    """The only dispersion of a table, its key written with underscores doubled for dots."""
    ((key, table),) = over.items()
    (found,) = dispersed(scenario, {key.replace("__", "."): table})
    return found


def made(name, width=1, factor=(), **numbers):
    """A distribution of numbers that are read already."""
    found = DISTRIBUTIONS[name].model_construct(distribution=name, **numbers)
    if isinstance(found, Spread):
        found._width = width
    if factor:
        found._factor = factor
    return found


def random(dims, count=20_000, seed=5):
    return np.random.default_rng(seed).random((dims, count))


def quantile(distribution, u):
    return float(distribution.draw(np.array([[u]]))[0, 0])


QUANTILES = {
    "uniform": lambda a, b: (made("uniform", low=[a], high=[a + b]), stats.uniform(a, b)),
    "normal": lambda a, b: (made("normal", mean=[a], sigma=[b]), stats.norm(a, b)),
    "log-normal": lambda a, b: (made("log-normal", median=[b], sigma=[0.003 * abs(a) + 0.01]),
                                stats.lognorm(0.003 * abs(a) + 0.01, scale=b)),
}  # fmt: skip


@pytest.mark.parametrize("name", QUANTILES)
@given(UNIFORM, REAL, WIDTH)
def test_quantiles_are_scipys(name, u, place, width):
    own, theirs = QUANTILES[name](place, width)
    assert quantile(own, u) == pytest.approx(theirs.ppf(u), rel=1e-9, abs=0.0 if name == "log-normal" else 1e-9)


def truncated(low, high, mean=0.0, sigma=1.0):
    return made("truncated-normal", mean=[mean], sigma=[sigma], low=[low], high=[high])


@given(UNIFORM, REAL, WIDTH, st.floats(-8.0, 8.0), st.floats(0.1, 5.0))
def test_quantiles_of_truncated_normal_are_scipys(u, mean, sigma, first, length):
    low, high = mean + first * sigma, mean + (first + length) * sigma
    found = truncated(low, high, mean, sigma)
    expected = stats.truncnorm((low - mean) / sigma, (high - mean) / sigma, loc=mean, scale=sigma).ppf(u)
    assert found.reached
    assert quantile(found, u) == pytest.approx(expected, rel=1e-6, abs=1e-6 * sigma)
    assert low <= quantile(found, u) <= high


def test_a_truncated_normal_may_be_open_and_far_in_its_tail():
    above = truncated(20.0, math.inf)
    assert quantile(above, 0.5) == pytest.approx(stats.truncnorm(20.0, math.inf).ppf(0.5), rel=1e-9)
    below = truncated(-math.inf, -20.0)
    assert quantile(below, 0.5) == pytest.approx(-quantile(above, 0.5), rel=1e-12)
    assert (above.bounded, below.bounded, truncated(1.0, 2.0).bounded) == (False, False, True)
    assert not truncated(60.0, 61.0).reached


@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=6))
def test_choices_are_as_likely_as_their_weights(weights):
    found = made("choice", values=[(float(n),) for n in range(len(weights))], weights=weights).draw(EVEN)
    shares = np.array([(found == n).mean() for n in range(len(weights))])
    assert np.abs(shares - np.array(weights) / sum(weights)).max() <= 1.0 / EVEN.size


def test_whole_numbers_are_all_as_likely():
    found = one(NOISE, law__mpc__horizon=uniform(5, 12)).draw(EVEN)
    values, counts = np.unique(found, return_counts=True)
    assert values.tolist() == list(range(5, 13))
    assert set(counts) == {EVEN.size // 8}


def test_correlated_normals_have_the_covariance_that_is_asked():
    mean, covariance = np.array([1.0, -2.0, 0.5]), np.array([[4.0, 1.0, 0.3], [1.0, 9.0, -2.0], [0.3, -2.0, 1.0]])
    factor = tuple(map(tuple, np.linalg.cholesky(covariance).tolist()))
    found = made("correlated-normal", mean=mean, factor=factor).draw(random(3, 200_000))
    assert np.abs(found.mean(axis=1) - mean).max() < 0.03
    assert np.abs(np.cov(found) - covariance).max() < 0.08
    # The squared distance from the mean, in the metric of the covariance, is chi-squared.
    away = found - mean[:, None]
    distance = np.einsum("in,ij,jn->n", away, np.linalg.inv(covariance), away)
    assert stats.kstest(distance, stats.chi2(3).cdf).pvalue > 1e-3


def test_a_symmetric_matrix_has_the_covariance_of_its_six_numbers():
    tensor = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.0], [0.0, 0.0, 4.0]]
    covariance = (np.diag([4.0, 1.0, 2.0, 9.0, 3.0, 16.0]) + np.full((6, 6), 0.5)) * 1e-6
    table = {"distribution": "correlated-normal", "covariance": covariance.tolist()}
    found = one(NOISE.with_({"spacecraft.inertia": tensor}), spacecraft__inertia=table)
    drawn = found.draw(random(6))
    assert np.abs(np.cov(drawn) - covariance).max() < 4e-7
    whole = found.arrays(dict(zip(found.columns, drawn, strict=True)))["spacecraft.inertia"]
    assert (whole == whole.swapaxes(1, 2)).all()
    assert whole.mean(axis=0) == pytest.approx(np.array(tensor), abs=2e-4)


def test_rotations_are_uniform():
    found = made("rotations").draw(random(3))
    assert np.abs(np.linalg.norm(found, axis=0) - 1.0).max() < 1e-15
    # A coordinate on the sphere in four dimensions: density 2 / pi sqrt(1 - x^2).
    for component in found:
        assert stats.kstest(component, lambda x: 0.5 + (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / math.pi).pvalue > 1e-3
    # The angle of a uniform rotation: density (1 - cos) / pi.
    angle = 2.0 * np.arccos(np.minimum(1.0, np.abs(found[0])))
    assert stats.kstest(angle, lambda x: (x - np.sin(x)) / math.pi).pvalue > 1e-3
    # The axis, whatever the angle: each coordinate is uniform.
    axis = found[1:] * np.sign(found[0]) / np.sin(0.5 * angle)
    for component in axis:
        assert stats.kstest(component, stats.uniform(-1.0, 2.0).cdf).pvalue > 1e-3


def test_shells_are_uniform_in_their_volume():
    low, high = 0.02, 0.07
    found = made("shell", low=low, high=high).draw(random(3))
    radius = np.linalg.norm(found, axis=0)
    assert radius.min() >= low * (1.0 - 1e-15)
    assert radius.max() <= high * (1.0 + 1e-15)
    assert stats.kstest(radius, lambda r: (r**3 - low**3) / (high**3 - low**3)).pvalue > 1e-3
    for component in found / radius:
        assert stats.kstest(component, stats.uniform(-1.0, 2.0).cdf).pvalue > 1e-3
    assert np.abs(np.corrcoef(found) - np.eye(3)).max() < 0.03


ALL = {
    "rotations": made("rotations"),
    "shell": made("shell", low=0.0, high=1.0),
    "correlated": made("correlated-normal", mean=(1.0, 2.0), factor=((1.0, 0.0), (0.5, 0.8))),
    "log-normal": made("log-normal", 2, median=(1.0, 2.0), sigma=(0.1, 0.2)),
    "truncated": made("truncated-normal", 2, mean=(0.0, 3.0), sigma=(1.0, 1.0), low=(-1.0, 0.0), high=(2.0, 1.0)),
}


@pytest.mark.parametrize("name", ALL)
@given(st.integers(0, 199), st.integers(1, 64))
def test_a_draw_depends_on_its_own_uniforms_alone(name, first, count):
    u = random(ALL[name].dims, 263)
    whole = ALL[name].draw(u)[:, first : first + count]
    assert (ALL[name].draw(np.ascontiguousarray(u[:, first : first + count])) == whole).all()


def test_shares_are_of_what_the_file_has():
    found = one(NOISE, spacecraft__inertia=normal(sigma=0.05, relative=True, judged_apart=True))
    drawn = found.draw(random(3))
    assert found.columns == ("spacecraft.inertia[1]", "spacecraft.inertia[2]", "spacecraft.inertia[3]")
    assert (found.distribution.judged_apart, found.scale, found.shape) == (True, (2.0, 3.0, 4.0), (3,))
    assert drawn.mean(axis=1) == pytest.approx([2.0, 3.0, 4.0], rel=0.01)
    assert drawn.std(axis=1) == pytest.approx([0.1, 0.15, 0.2], rel=0.03)
    together = one(NOISE, spacecraft__inertia=normal(sigma=0.05, relative=True, together=True))
    assert together.dims == 1
    drawn = together.draw(random(1))
    assert drawn / drawn[0] == pytest.approx(np.array([[1.0], [1.5], [2.0]]) * np.ones_like(drawn), rel=1e-14)
    shell = one(NOISE, initial__rate={"distribution": "shell", "low": "50 %", "high": 2, "relative": True})
    size = math.sqrt(0.0029)
    assert np.linalg.norm(shell.draw(random(3)), axis=0) == pytest.approx(1.25 * size, abs=0.76 * size)


def test_numbers_have_the_units_of_their_key():
    found = one(NOISE, initial__rate=normal(mean=["1 deg/s", 0, 0], sigma="0.1 deg/s"))
    assert (found.distribution.mean, found.distribution.sigma) == ((math.radians(1.0), 0.0, 0.0), (math.radians(0.1),) * 3)
    both = one(
        NOISE,
        **{
            "law__lyapunov__k_rate, law__lyapunov__k_attitude": {
                "distribution": "correlated-normal",
                "sigma": ["10 mN m s", "1 mN m"],
                "correlation": [[1.0, 0.5], [0.5, 1.0]],
            }
        },
    )
    assert both.distribution.mean == (0.09, 0.009)
    assert tuple(both.distribution._factor[0]) == (0.01, 0.0)
    assert np.hypot(*both.distribution._factor[1]) == pytest.approx(0.001)


def test_a_symmetric_matrix_stays_one():
    scenario = NOISE.with_({"spacecraft.inertia": FULL})
    found = one(scenario, spacecraft__inertia=normal(sigma="0.05 kg m^2"))
    assert found.columns == tuple(
        f"spacecraft.inertia[{a}][{b}]" for a, b in [(1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)]
    )
    columns = dict(zip(found.columns, found.draw(random(found.dims, 50)), strict=True))
    full = found.arrays(columns)["spacecraft.inertia"]
    assert full.shape == (50, 3, 3)
    assert (full == full.transpose(0, 2, 1)).all()
    assert (full[:, 1, 2] == columns["spacecraft.inertia[2][3]"]).all()
    made = scenario.with_(found.change({name: column[7] for name, column in columns.items()}))
    assert np.array_equal(made.craft.inertia, full[7])


def test_angles_beyond_a_turn_keep_their_value():
    scenario = load("l2-circle")
    found = one(scenario, initial__phase=uniform("-400 deg", "800 deg"))
    drawn = found.draw(EVEN[:, -3:])
    assert scenario.with_(found.change({"initial.phase": drawn[0, 1]})).table.initial.phase == drawn[0, 1] > math.tau


def test_a_distribution_is_one_class():
    """It is found by its name, read in its key's units, drawn, and refused as those that come along are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("starhold.scenario.distribution.DISTRIBUTIONS", dict(DISTRIBUTIONS))
        patch.setattr("starhold.scenario.distributions.DISTRIBUTIONS", distribution.DISTRIBUTIONS)

        class Triangular(Spread):
            BOUNDED = True
            distribution: Literal["triangular"]
            half: Annotated[Any, *raw("half the width")]

            def _numbers(self, key):
                return {"half": key.numbers("half", checked=False), "mean": key.centre("mean")}

            mean: Annotated[Any, *raw("by default the file's value")] = None

            def draw(self, u):
                side = np.where(u < 0.5, np.sqrt(2.0 * u) - 1.0, 1.0 - np.sqrt(2.0 * (1.0 - u)))
                return np.array(self.mean)[:, None] + np.array(self.half)[:, None] * side

        found = one(NOISE, initial__rate={"distribution": "triangular", "half": "1 deg/s"})
        assert (found.dims, found.distribution.bounded, found.distribution.independent) == (3, True, True)
        rate = stats.triang(0.5, loc=found.distribution.mean[0] - math.radians(1.0), scale=math.radians(2.0))
        assert stats.kstest(found.draw(random(3))[0], rate.cdf).pvalue > 1e-3
        with refused(".half: found", start="three-laws-noise: campaign.over"):
            one(NOISE, initial__rate={"distribution": "triangular", "half": "1 m"})
    assert "triangular" not in DISTRIBUTIONS


def test_a_draw_beyond_the_bounds_of_its_key_is_refused():
    found = one(NOISE, law__lyapunov__k_rate=normal(sigma=0.05))
    assert found.draw(np.array([[0.5]]))[0, 0] == 0.09
    with pytest.raises(InputError, match=r'over."law.lyapunov.k_rate": found a draw of -.*above 0; a truncated-normal'):
        found.draw(np.array([[0.5, 0.01]]))


PAIR = "law.lyapunov.k_rate, law.lyapunov.k_attitude"


def pair(**more):
    return {PAIR: {"distribution": "correlated-normal", "sigma": [0.01, 0.001], "correlation": [[1, 0.5], [0.5, 1]], **more}}


def choice(*values, **more):
    return {"distribution": "choice", "values": values, **more}


BAD = {
    "unknown key": ({"initial.rat": normal(sigma=1)}, "rate?"),
    "unknown distribution": (
        {"initial.rate": {"distribution": "normel"}},
        '.distribution: found "normel"; did you mean normal?',
    ),
    "unknown parameter": (
        {"initial.rate": {"distribution": "normal", "sigm": 1}},
        ".sigm: found an unknown key; did you mean sigma?",
    ),
    "negative sigma": ({"initial.rate": normal(sigma=-1)}, ".sigma: found -1; allowed: above 0"),
    "sigma zero": ({"initial.rate": normal(sigma=0)}, ".sigma: found 0; allowed: above 0"),
    "sigma of nothing": ({"initial.rate[1]": normal(sigma=0.1, relative=True)}, "no shares of 0.0"),
    "shares that are not said to be": (
        {"spacecraft.torque_limit": normal(sigma="10 %")},
        '.sigma: found "10 %"; allowed: a quantity in N m; for shares of the file\'s value use relative = true',
    ),
    "unit of sigma": ({"initial.rate": normal(sigma="1 m")}, ".sigma: found"),
    "low above high": ({"initial.rate": uniform(1, 0)}, ".low: found 1; allowed: below high"),
    "low is refused": ({"law.lyapunov.k_rate": uniform(0, 1)}, ".low: found 0.0; allowed: above 0"),
    "shares are refused": ({"law.lyapunov.k_rate": uniform(0, 2, relative=True)}, ".low: found 0.0; allowed: above 0"),
    "weights of another length": (
        {"spacecraft.limit": choice("axis", "norm", weights=[1])},
        ".weights: found 1 weights; allowed: one for each of the 2 values",
    ),
    "weight zero": (
        {"spacecraft.limit": choice("axis", "norm", weights=[1, 0])},
        ".weights[2]: found 0; allowed: a number above 0",
    ),
    "unknown word": ({"spacecraft.limit": choice("axis", "norn")}, '.values[2]: found "norn"'),
    "one choice": ({"spacecraft.limit": choice("axis", "axis")}, "two values that differ"),
    "a word is no number": ({"spacecraft.limit": normal(sigma=1)}, "choice, because the key holds a word"),
    "a whole number": ({"law.mpc.horizon": normal(sigma=1)}, "uniform or choice, because the key holds a whole number"),
    "not positive definite": (pair(correlation=[[1, 2], [2, 1]]), "positive definite"),
    "not symmetric": (pair(correlation=[[1, 0.2], [0.3, 1]]), "symmetric"),
    "sigma of another length": (pair(sigma=[1]), "2 values, one for each key"),
    "two matrices": (pair(covariance=[[1, 0], [0, 1]]), "either correlation with sigma, or covariance"),
    "several of another": ({PAIR: normal(sigma=1)}, "2 keys with the distribution normal"),
    "twice by name and place": (
        {"law.lyapunov.k_rate": normal(sigma=1e-3), "law[1].k_rate": normal(sigma=1e-3)},
        "a second dispersion of law[1].k_rate",
    ),
    "a whole table": ({"initial": normal(sigma=1)}, "whole table"),
    "no value to be a mean": ({"spacecraft.torque_rate_limit": normal(sigma=1)}, ".mean: found nothing"),
    "beyond reach": (
        {"law.mpc.r": {"distribution": "truncated-normal", "sigma": 1e-3, "low": 100, "high": 200}},
        ".low: found 100; allowed: an interval where the normal distribution has probability",
    ),
    "uncut": ({"law.mpc.r": {"distribution": "truncated-normal", "sigma": 1}}, "low, high or both"),
    "median zero": ({"sensor.rate_noise": {"distribution": "log-normal", "median": 0, "sigma": 1}}, ".median: found 0"),
    "rotations of a rate": ({"initial.rate": {"distribution": "rotations"}}, "attitude as a quaternion"),
    "shell of an attitude": ({"initial.attitude": {"distribution": "shell", "high": 1}}, "vector of three"),
    "hollow shell": ({"initial.rate": {"distribution": "shell", "low": 2, "high": 1}}, ".low: found 2"),
    "no key": ({3: normal(sigma=1)}, "campaign.over"),
    "no number at all": ({"initial.rate": normal(sigma=object())}, "object"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_dispersed_is_told_in_one_line(name):
    over, said = BAD[name]
    with refused(said, start="three-laws-noise: campaign.over"):
        dispersed(NOISE.with_({"initial.rate": [0, 0.03, 0.02]}), over)
