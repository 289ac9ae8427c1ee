"""Arguments of a wrong type are refused in one line that says what is taken."""

import pytest

import starhold as sh

SOURCES = (
    *("load", "simulate", "compare", "certify", "design", "budget", "failures", "verify", "review", "linearise", "margins"),
    *("modal_roots", "stepper", "environment", "phasing"),
)


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize(("given", "shown"), [({"name": "mine"}, "a dict"), (5, "5"), (None, "None")])
def test_who_takes_a_scenario_says_so(name, given, shown):
    with pytest.raises(sh.InputError) as error:
        getattr(sh, name)(given)
    assert str(error.value) == (
        f"scenario: found {shown}; allowed: a scenario, or the name of a file or of a built-in scenario; "
        "sh.scenario takes tables"
    )


@pytest.mark.parametrize("given", ["three-laws", 5, None, ["three-laws"]])
def test_tables_are_not_a_name(given):
    with pytest.raises(sh.InputError, match=r"allowed: tables, \{.*\}; sh\.load reads a file or a name") as error:
        sh.scenario(given)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "more", "said"),
    [
        ("metrics", (), "metrics: found {}; allowed: a run of sh.simulate, or a flight of sh.compare"),
        ("export_aem", ("x.aem",), "run: found {}; allowed: a run of sh.simulate, a run.nc, or the folder of one"),
        ("export_oem", ("x.oem",), "run: found {}; allowed: a run of sh.simulate, a run.nc, or the folder of one"),
        ("read_aem", (), "message: found {}; allowed: the name of a file"),
        ("read_oem", (), "message: found {}; allowed: the name of a file"),
        ("invariant", (), "invariant: found {}; allowed: a problem, or the name of a file or of a built-in problem"),
        ("reproduce", (), "reproduce: found {}; allowed: A, B, C, D, E"),
    ],
)
@pytest.mark.parametrize(("given", "shown"), [({"a": 1}, "a dict"), (5, "5"), (None, "None")])
def test_others_say_what_they_take(name, more, said, given, shown):
    with pytest.raises(sh.InputError) as error:
        getattr(sh, name)(given, *more)
    assert str(error.value) == said.format(shown)
