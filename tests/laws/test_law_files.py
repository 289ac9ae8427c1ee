"""Laws from files and from other packages: scenarios fly them, proofs read them, and what is wrong with one is one line."""

import json

import numpy as np
import pytest

import starhold as sh
from starhold.checker import check_file, passed
from starhold.conformance.suite import find_law
from starhold.laws.catalogue import adopted, catalogue, from_file
from tests.laws.files import FILES
from tests.parts.files import BODY, POINT
from tests.refusals import complains, refused, replaced, rows
from tests.running import starhold

LAW, STATION = FILES["my_law.py"], FILES["hold_point.py"]
OWN = '[[law]]\nfile = "laws/my_law.py"\nk_rate = 0.09\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "my_law.py").write_text(LAW)
    (tmp_path / "laws" / "point.py").write_text(STATION)
    (tmp_path / "own.toml").write_text(BODY + OWN + '[[law]]\ntype = "pd"\nk_rate = 0.09\nk_attitude = 0.01\n')
    return tmp_path


def test_a_law_beside_the_scenario_flies_as_the_same_law_of_starhold_does(folder):
    scenario = sh.load(folder / "own.toml")
    assert [entry.name for entry in scenario.laws] == ["my-law", "pd"]
    mine, pd = (sh.simulate(scenario, law) for law in ("my-law", "pd"))
    np.testing.assert_allclose(mine.attitude_error, pd.attitude_error, rtol=0.0, atol=1e-12)
    flights = sh.compare(scenario)
    assert [flight.law for flight in flights] == ["my-law", "pd"]
    outcomes = [{claim.kind: claim.outcome for claim in flight.certificates[0].claims} for flight in flights]
    assert outcomes[0] == outcomes[1]
    assert outcomes[0]["convergence"] == "proved"


def test_it_is_read_again_where_its_text_has_changed_and_only_then(folder):
    first = sh.load(folder / "own.toml").laws[0].law
    assert sh.load(folder / "own.toml").laws[0].law is not None
    assert sh.load(folder / "own.toml").laws[0].law == first
    (folder / "laws" / "my_law.py").write_text(LAW.replace("= 0.01\n", "= 0.018\n"))
    assert sh.load(folder / "own.toml").laws[0].gains.k_attitude == 0.018
    assert first.gains._field_defaults["k_attitude"] == 0.01


@pytest.mark.slow
def test_command_line_compares_it_and_checks_its_certificate(folder):
    starhold("compare", "own.toml", "--pictures", "page", "-o", "out", cwd=folder, code=0)
    told = json.loads((folder / "out" / "certificate.json").read_text())["certificates"]
    assert [one["subject"]["law"] for one in told] == ["my-law", "pd"]
    # The law is not run because a certificate names it.
    bare = starhold("check", "out/certificate.json", cwd=folder, code=0)
    assert "were not compared" in bare.stdout
    starhold("check", "out/certificate.json", "--law-file", "laws/my_law.py", cwd=folder, code=0)
    assert "starhold check certificate.json --law-file my_law.py</code>" in (folder / "out" / "report.html").read_text()
    # What is printed can be run as it stands.
    proved = starhold("certify", "own.toml", "--law", "my-law", "-o", "proved", cwd=folder, code=0)
    command = proved.stdout.rpartition("Re-check it: starhold ")[2].split()
    assert command[2] == "--law-file"
    assert starhold(*command, cwd=folder).returncode == 0
    assert "stiffness" in starhold("laws", "laws/my_law.py", cwd=folder).stdout


@pytest.mark.slow
def test_its_proofs_are_not_about_another_text_of_the_law(folder, tmp_path):
    from starhold.certification.certificate import write
    from starhold.studies.certificates import compare_programs

    proved = tmp_path / "c.json"
    write(sh.certify(folder / "own.toml", "my-law"), "own", proved)
    assert compare_programs(proved, sh.load(folder / "own.toml")) == []
    path = folder / "laws" / "my_law.py"
    path.write_text(LAW.replace("scale(gains.k_rate,", "scale(0.5 * gains.k_rate,"))
    assert "my-law: the program of the law differs" in compare_programs(proved, sh.load(folder / "own.toml"))
    # What the file says of its own programs holds all the same.
    with adopted(from_file(path)):
        assert passed(check_file(proved))
    assert "my-law" not in catalogue()


WRONG = rows("""
file = "nope.py" | law[1].file: found "nope.py": No such file or directory; allowed: a Python file
file = "my_law.py"↵type = "pd" | either a type or a file, not both
file = 3 | law[1].file: found 3; allowed: the name of a Python file
file = "my_law.py"↵k_rate = 1↵q = 2 | law[1].q: found an unknown key; allowed: one of
file = "my_law.py"↵k_rate = -1 | law[1].k_rate: found -1; allowed: above 0
file = "my_law.py"↵form = "I" | no form; my-law needs its gains
k = 1 | law[1].type: found nothing; allowed: one of
""")


@pytest.mark.parametrize(("table", "said"), WRONG)
def test_what_is_wrong_with_a_law_table_is_one_line(table, said, folder):
    path = folder / "laws" / "wrong.toml"
    path.write_text(BODY + f"[[law]]\n{table}\n")
    with refused(said):
        sh.load(path)


BROKEN = rows("""
def torque | def torques | a law needs control or torque
gains.k_rate, measurement.rate | gains.k_rate, measurement.rates | law my-law: my_law.py, line 24: AttributeError
, memory↵↵ | ↵↵ | torque must return three numbers and the memory
, memory↵↵ | , (1.0,)↵↵ | the memory that torque returns must have the form of its argument
""")


@pytest.mark.parametrize(("old", "new", "said"), BROKEN)
def test_what_is_wrong_in_a_law_file_is_one_line(old, new, said, folder):
    (folder / "laws" / "my_law.py").write_text(replaced(LAW, old, new))
    with refused(said):
        sh.simulate(folder / "own.toml")


def test_an_interrupt_in_a_law_file_is_the_users_in_python_and_the_files_under_a_command(folder):
    """A command has a handler of its own for Ctrl-C, which raises something else."""
    (folder / "laws" / "my_law.py").write_text(LAW.replace("CARD = Card(", "raise KeyboardInterrupt\nCARD = Card("))
    with pytest.raises(KeyboardInterrupt):
        sh.load(folder / "own.toml")
    complains(starhold("run", "own.toml", cwd=folder), "my_law.py, line 9: KeyboardInterrupt")


def test_links_in_a_circle_are_told_in_one_line(folder):
    (folder / "laws" / "my_law.py").unlink()
    (folder / "laws" / "my_law.py").symlink_to(folder / "other.py")
    (folder / "other.py").symlink_to(folder / "laws" / "my_law.py")
    for words in (("run", "own.toml"), ("check-part", "other.py"), ("laws", "other.py"), ("parts", "other.py")):
        complains(starhold(*words, cwd=folder), "Too many levels of symbolic links")


def test_a_file_with_the_name_of_another_law_is_refused_and_the_law_s_own_is_it(folder):
    own = catalogue()["pd"].module.__file__
    (folder / "laws" / "pd.py").write_text(LAW)
    with pytest.raises(sh.InputError, match="a part named pd is installed already; rename the file"):
        find_law(str(folder / "laws" / "pd.py"))
    assert find_law(own) is find_law("pd") is catalogue()["pd"]
    (folder / "own.toml").write_text(BODY + f"[[law]]\nfile = {json.dumps(own)}\nk_rate = 0.09\nk_attitude = 0.009\n")
    assert sh.load(folder / "own.toml").laws[0].law is catalogue()["pd"]


def test_laws_of_other_packages_for_both_bodies_are_found(folder, recwarn, offer):
    before = set(catalogue()), set(catalogue("libration-point"))
    offer(folder / "laws", "my_law", "point")
    turning, holding = catalogue(), catalogue("libration-point")
    assert set(turning) - before[0] == {"my-law"}
    assert set(holding) - before[1] == {"point"}
    assert not recwarn.list
    (folder / "own.toml").write_text(POINT + '[[law]]\ntype = "point"\nk = 20.0\nlead = 0.45\n')
    assert sh.simulate(folder / "own.toml").attrs["law"] == "point"
    # A law that is installed is taken by its name and by its file.
    assert find_law("my-law") is find_law(str(folder / "laws" / "my_law.py")) is turning["my-law"]


def test_one_that_takes_the_name_of_another_is_left_out(folder, offer):
    (folder / "laws" / "sliding.py").write_text(LAW)
    own = catalogue()["sliding"].module
    offer(folder / "laws", "sliding")
    with pytest.warns(UserWarning, match="the part sliding is left out: ValueError: a part named sliding exists already"):
        found = catalogue()
    assert found["sliding"].module is own
