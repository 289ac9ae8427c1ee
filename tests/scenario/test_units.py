"""Quantities: numbers and units are read strictly, and only what a unit is worth is asked of the library."""

import json
import math
import re

import pint
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import starhold as sh
from starhold.scenario import units
from starhold.scenario.reading import builtin_text, parse
from starhold.scenario.units import LONGEST, to_number
from starhold.scenario.values import locate
from tests.refusals import rows

REGISTRY = pint.UnitRegistry()
NAMES = ["m", "km", "cm", "s", "ms", "min", "h", "N", "mN", "kg", "rad", "deg", "rpm", "arcsec"]

factors = st.lists(
    st.tuples(st.sampled_from([" ", "*", "/", " / ", "·"]), st.sampled_from(NAMES), st.integers(-2, 2).filter(bool)),
    min_size=1,
    max_size=4,
)


def written(chosen):
    """A unit as it may be written, and as the library's own parser takes it."""
    text, plain = "", ""
    for joint, name, power in chosen:
        raised = "" if power == 1 else f"^{power}"
        text += (joint if text else "") + name + raised
        plain += (f" {joint.strip() or '*'} ".replace("·", "*") if plain else "") + f"{name}**({power})"
    return text, plain


@given(st.floats(-1e6, 1e6), factors)
def test_units_are_read_as_the_library_reads_them(number, chosen):
    text, plain = written(chosen)
    parsed = REGISTRY.parse_units(plain)
    root = {name: int(power) for name, power in REGISTRY.get_root_units(parsed)[1]._units.items()}
    # Larger exponents are refused.
    assume(root and all(abs(power) < 10 for power in [*root.values(), *parsed._units.values()]))
    expected = REGISTRY.Quantity(number, parsed).to_root_units().magnitude
    found = to_number(f"{number!r} {text}", " ".join(f"{name}^{power}" for name, power in root.items()))
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-300)


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from([*units.COMMON]))
def test_units_of_most_files_are_worth_what_the_library_says(number, pair):
    text, unit = pair
    assert units.COMMON[pair] * number == units._convert(number, units._powers(text, unit), unit)
    assert to_number(f"{number!r} {text}", unit) == units.COMMON[pair] * number


SAME = rows("""
20 mNm | 20 mN m | N m
3 kNm | 3000 N m | N m
5 µNm | 5e-6 N m | N m
4 Nms | 4 N m s | N m s
4 mN·m·s | 0.004 N m s | N m s
4 N-m-s | 4 N m s | N m s
4 N.m | 4 N m | N m
7 Nm/s | 7 N m/s | N m/s
2 kgm² | 2 kg m^2 | kg m^2
2 kg m2 | 2 kg m^2 | kg m^2
2 kg·m**2 | 2 kg m^2 | kg m^2
20 kg cm ^ 2 | 0.002 kg m^2 | kg m^2
9 m s⁻² | 9 m/s^2 | m/s^2
9 m s-2 | 9 m/s^2 | m/s^2
50 /(N m)² | 50 1/(N m)^2 | 1/(N m)^2
50 1/(mN m)^2 | 5e7 1/(N m)^2 | 1/(N m)^2
500km | 500 km | m
1_000 km | 1000 km | m
30° | 30 deg | rad
3°/s | 3 deg/s | rad/s
5 % | 0.05 | 1
20 dB | 10 | 1
-6 dB | 0.5011872336272722 | 1
1 N m/(rad/s) | 1 N m s | N m s
2 1/s | 2 rad/s | rad/s
398600 km^3/s^2 | 3.986e14 m^3/s^2 | m^3/s^2
60 °/√h | 1 deg/s/√Hz | rad/sqrt(s)
60 deg/sqrt(h) | 1 deg/s^0.5 | rad/sqrt(s)
60 deg/h^(1/2) | 1 deg s^-0.5 | rad/sqrt(s)
60 deg h⁻¹ Hz^(-1/2) | 60 (deg/h)/√(Hz) | rad/sqrt(s)
60 deg/(sqrt(h)) | 60 deg/h**.5 | rad/sqrt(s)
60 deg/h/sqrt(h) | 60 deg/h^(3/2) | rad/s/sqrt(h)
1 deg/h/√s | 60 deg/h^1.5 | rad/s/sqrt(h)
9 sqrt(m^2 s^4) | 9 m s^2 | m s^2
5 √kg m | 5 kg^0.5 m | kg^(1/2) m
12 pT/√Hz | 0.012 nT/sqrt(Hz) | T/sqrt(Hz)
""")


@pytest.mark.parametrize(("text", "same", "unit"), SAME)
def test_spellings(text, same, unit):
    assert to_number(text, unit) == pytest.approx(to_number(same, unit), rel=1e-14)


REFUSED = rows("""
s | 9**9**9 s | 9 s**9**9 | 9 (s^9)^9 | 9 s^99 | 1 ((s)) | 1 s s s s s s s s s s | 1/3 s | 2*3 s | 0x10 s | nan s | inf | ٣ s
s | 1 s^ | 1 (s | 1 s) | 1 s/ | 1 s//s | 1 __import__('os') | 1 degC | s | | 1 | 1 kg
rad/s | 1 Hz | 1 kHz
rad | 1 | 5 % | 1 1/s | 6 dB
rad/sqrt(s) | 1 deg/h | 1 Hz | 1 1/s/sqrt(Hz) | 1 sqrt h | 1 sqrt(h | 1 deg/√ | 1 deg/√(√(h)) | 1 deg/h^(2/2) | 1 deg/h^0.25
1 | 30 deg | 3 bit | 5 %^2 | 6 dB^2
""")
REFUSED += [["s", f"{'1' * LONGEST} s"]]


@pytest.mark.parametrize(("unit", "text"), [(unit, text) for unit, *texts in REFUSED for text in texts])
def test_what_is_no_quantity_is_refused_with_the_unit_that_is_asked_for(unit, text):
    with pytest.raises(ValueError, match=r"^a (number, or a string|quantity in)"):
        to_number(text, unit)


def gyro(noise, walk=0.0):
    part = {"type": "gyro", "noise": noise, "bias_walk": walk}
    return sh.load("cubesat-detumble").with_({"part": [part]}).parts[0].params


def test_the_random_walks_of_a_gyro_are_read_from_its_data_sheet():
    """The angle that white noise makes up in a second, and the bias's change within an hour, are the sheet's numbers."""
    found = gyro("0.15 deg/sqrt(h)", "3 deg/h/sqrt(h)")
    assert found.noise == pytest.approx(math.radians(0.15) / 60.0, rel=1e-15)
    assert found.bias_walk == pytest.approx(math.radians(3.0) / 3600.0, rel=1e-15)
    same = gyro("9 deg/h/√Hz", "3 deg/h")
    assert (same.noise, same.bias_walk) == pytest.approx((found.noise, found.bias_walk), rel=1e-15)
    assert gyro("1e-4 rad/s/sqrt(Hz)").noise == gyro("1e-4 rad/s").noise == 1e-4


def test_what_is_no_random_walk_is_refused_with_both_units():
    for wrong in ("0.15 deg/h/sqrt(h)", "0.15 deg", "0.15 deg/sqrt(m)", "0.15 furlong"):
        with pytest.raises(sh.InputError, match=r"noise: found .*; allowed: a quantity in rad/s or in rad/sqrt\(s\)$"):
            gyro(wrong)
    with pytest.raises(sh.InputError, match=r"bias_walk: .*a quantity in rad/s or in rad/s/sqrt\(h\)$"):
        gyro(0.0, "3 deg/sqrt(h)")


def test_the_noise_of_a_magnetometer_is_a_deviation_or_a_density():
    def read(**numbers):
        return sh.load("cubesat-detumble").with_({"part": [{"type": "magnetometer"} | numbers]}).parts[0].params

    assert read(noise_density="10 nT/√Hz").noise_density == pytest.approx(1e-8, rel=1e-15)
    with pytest.raises(sh.InputError, match=r"noise: found .*; allowed: a quantity in T$"):
        read(noise="10 nT/√Hz")
    with pytest.raises(sh.InputError, match=r'noise_density: found 10.0; .*"10 nT/sqrt\(Hz\)"'):
        read(noise_density=10.0)


PARTS = rows("""
magnetometer | noise | 50.0 | "50 nT" or "50 T"
magnetometer | noise | 1e-4 | "0.0001 nT" or "0.0001 T"
gyro | noise | 0.15 | "0.15 deg/sqrt(h)" or "0.15 rad/s"
gyro | bias | [10.0, 0.0, 0.0] | "10 deg/s" or "10 rad/s"
gyro | bias_walk | 2.0 | "2 deg/h/sqrt(h)" or "2 rad/s"
gyro | axis_errors | [500.0, 0.0, 300.0] | "500 ppm"
gyro | delay | 100.0 | "100 ms" or "100 s"
constant-torque | torque | [0.0, 200.0, 0.0] | "200 mN m" or "200 N m"
residual-dipole | dipole | [6000.0, 0.0, 0.0] | "6000 mA m^2" or "6000 A m^2"
""")


@pytest.mark.parametrize(("kind", "key", "value", "meant"), PARTS)
def test_a_plain_number_of_a_part_is_asked_for_its_unit(kind, key, value, meant):
    with pytest.raises(sh.InputError, match=rf"{key}: found .*{re.escape(meant)}$"):
        sh.load("cubesat-detumble").with_({"part": [{"type": kind, key: json.loads(value)}]})


BIG = {"spacecraft.inertia": [1e4, 1e4, 1e4], "wheels.inertia": 1.0}
LARGE = rows("""
spacecraft.inertia | [5e9, 5e9, 4e9] | 5e+09 | g cm^2 | kg m^2
wheels.inertia | 20.0 | 20 | g cm^2 | kg m^2
wheels.torque_limit | 4.0 | 4 | mN m | N m
wheels.coulomb | 1.0 | 1 | mN m | N m
wheels.viscous | 2.0 | 2 | uN m s | N m s
wheels.momentum_limit | 4000.0 | 4000 | mN m s | N m s
spacecraft.torque_limit | 2000.0 | 2000 | mN m | N m
environment.torque_noise | 20.0 | 20 | mN m | N m
initial.rate | [10.0, 0.0, 0.0] | 10 | deg/s | rad/s
settling.rate_tolerance | 10.0 | 10 | deg/s | rad/s
""")


@pytest.mark.parametrize(("key", "value", "number", "meant", "unit"), LARGE)
def test_a_plain_number_far_above_its_kind_is_asked_for_its_unit(key, value, number, meant, unit):
    scenario, value = sh.load("wheels-orbital").with_(BIG), json.loads(value)
    allowed = re.escape(f'with a unit it is "{number} {meant}" or "{number} {unit}"')
    with pytest.raises(sh.InputError, match=rf"{re.escape(key)}: found .*{allowed}$"):
        scenario.with_({key: value})
    # What states its unit is taken; so is what a campaign draws, which states it where it has to.
    place = locate(scenario, key)
    assert locate(scenario.with_(place.change(value)), key).value == (tuple(value) if isinstance(value, list) else value)


def test_masses_and_speeds_that_no_craft_has_are_refused():
    """Against a ball of osmium, 22.59 g/cm3, with 1 m of radius; and rotors of 0.4 N m s whose momentum is 50 times that."""
    ball = 4.0 / 3.0 * math.pi * 22_590.0
    craft = sh.load("cubesat-detumble").with_({"spacecraft.inertia": [0.4 * ball] * 3})
    assert craft.with_({"spacecraft.mass": ball}).table.spacecraft.mass == ball
    with pytest.raises(
        sh.InputError, match=r"spacecraft.mass: found .*; allowed: at most 9.4[67]e\+04 kg: .*another unit meant"
    ):
        craft.with_({"spacecraft.mass": 1.01 * ball})
    wheels = sh.load("wheels-orbital")
    told = r"wheel 1 turns at 1.91e\+05 rpm at its largest momentum, 20 N m s: is another unit meant"
    with pytest.raises(sh.InputError, match=told):
        wheels.with_({"wheels.momentum_limit": 20.0})


@given(st.text("0123456789.eE+-_*^/() sNmkgrade°²⁻", max_size=30), st.sampled_from(["s", "N m", "rad", "1", "1/(N m)^2"]))
def test_no_text_ends_in_anything_but_a_number_or_one_line(text, unit):
    try:
        value, said = to_number(text, unit), "a "
    except ValueError as error:
        value, said = 0.0, str(error)
    assert said.startswith("a ")
    assert "\n" not in said
    assert not math.isnan(value)


def test_what_fails_in_the_units_library_is_no_fault_of_the_file(monkeypatch):
    def fails():
        raise TypeError("cannot inherit frozen dataclass from a non-frozen one")

    monkeypatch.setattr(units, "unit_registry", fails)
    with pytest.raises(TypeError, match="frozen dataclass"):
        parse(builtin_text("three-laws").replace("duration = 2000.0", 'duration = "0.1 hour"'), "own.toml")
