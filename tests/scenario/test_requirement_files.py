"""Requirements come from the files of other tools and go there, with their ids and with what those tools say of them."""

from pathlib import Path

import pytest

import starhold as sh
from starhold.scenario import reqif
from tests.refusals import complains, refused
from tests.running import starhold
from tests.texts import toml

SAMPLE = Path(__file__).with_name("polarion.reqif")
"""From the tests of the package reqif (strictdoc-project, Apache-2.0)."""
BASE = toml("""
name = "own"
[spacecraft] inertia = [2.0, 3.0, 4.0]
[[requirement]] file = "{}"
[simulation] duration = 5.0; control_period = 0.1
[[law]] type = "pd"; k_rate = 0.09; k_attitude = 0.009
""")
SHEETS = {
    "comma": 'id,text,method,metric,at_most,window,Owner\nS-1,"a, b",flight,peak_rate,0.1,"[1, ""2 s""]",Jürgen\n',
    "semicolon": 'Owner;AT MOST;Metric;Method;ID;Window;Object Text\nJürgen;0,1;peak_rate;flight;S-1;[1, "2 s"];a, b\n\n',
    "tab": 'ID\ttext\tmethod\tmetric\tat-most\tOwner\twindow\nS-1\ta, b\tflight\tpeak_rate\t0.1\tJürgen\t[1, "2 s"]\n',
}


def scenario_of(folder, name, data):
    (folder / name).write_bytes(data)
    (folder / "own.toml").write_text(BASE.format(name), encoding="utf-8")
    return sh.load(folder / "own.toml")


@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_spreadsheet_is_read_and_written_without_loss(tmp_path, sheet, mark):
    scenario = scenario_of(tmp_path, "spec.csv", mark + SHEETS[sheet].replace("\n", "\r\n").encode())
    (one,) = scenario.table.requirement
    assert (one.id, one.text, one.metric, one.at_most, one.window) == ("S-1", "a, b", "peak_rate", 0.1, [1, "2 s"])
    assert one.attributes == {"Owner": "Jürgen"}
    again = sh.export_requirements(scenario, tmp_path / "again.csv").read_bytes()
    back = scenario_of(tmp_path, "back.csv", again).table.requirement
    assert back == [one]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "an empty file"),
        ("a,b\n1,2\n", "no column id"),
        ("id,ID\n1,2\n", 'spec.csv: "ID": found a second column'),
        ("id,method\nS-1,flight,3\n", "requirement 1: found 3 cells"),
        ("id,method\nS-1,fly\n", 'requirement 1 S-1.method: found "fly"'),
        ("id,method,metric,window\nS-1,flight,effort,1 to 2\n", 'requirement 1.window: found "1 to 2"; allowed: a list'),
        ("id,text\nS-1,prose\n", "requirement[1].method: found nothing"),
        ("id,method\nS-1,inspection\ns-1,inspection\n", "requirement[2].id"),
        ('id,text\nS-1,"open\n', "not CSV"),
    ],
)
def test_a_faulty_sheet_is_told_in_a_line(tmp_path, text, line):
    with refused(line):
        scenario_of(tmp_path, "spec.csv", text.encode())


def test_other_files_are_refused(tmp_path):
    for name, data, line in (
        ("spec.csv", "id,text\nS,é\n".encode("latin-1"), "CSV in UTF-8"),
        ("spec.xlsx", b"PK", ".csv or .reqif"),
        ("spec.reqif", b"<REQ-IF>", "reqif"),
    ):
        with refused(line):
            scenario_of(tmp_path, name, data)
    (tmp_path / "spec.reqif").unlink()
    with refused("allowed: a file that can be read"):
        sh.load(tmp_path / "own.toml")
    with refused("requirement[1].id: found a key beside a file"):
        sh.load("three-laws").with_({"requirement": [{"file": "spec.csv", "id": "x"}]})


def test_reqif_goes_in_and_out_without_loss(tmp_path):
    parser, unparser = pytest.importorskip("reqif.parser"), pytest.importorskip("reqif.unparser")
    data = SAMPLE.read_bytes()
    whole = unparser.ReqIFUnparser.unparse(parser.ReqIFParser.parse_from_string(data.decode()))
    rows = reqif.read(data, "x")
    assert [row.get("ReqIF.ForeignID", row.get("id")) for row in rows][1] == "LOREM-818"
    assert rows[1]["Status"] == "Draft"
    assert rows[1]["parent"] == rows[0]["id"]
    # Nothing has changed, so the file is the same; then what is required is said in it, and everything else stays.
    keyed = [dict(reqif.keyed(row)) for row in rows]
    assert reqif.written(keyed, "t", data, "x") == whole
    decided = keyed[1] | {"method": "flight", "metric": "peak_rate", "at_most": "1 deg/s"}
    more = {"id": "NEW-1", "method": "inspection", "Owner": "me & you"}
    changed = reqif.written([keyed[0], decided, more], "t", data, "x").encode()
    scenario = scenario_of(tmp_path, "spec.reqif", changed)
    heading, one, new = scenario.table.requirement
    assert (heading.id, one.parent, one.id, one.at_most) == (rows[0]["id"], rows[0]["id"], "LOREM-818", "1 deg/s")
    assert one.attributes == {name: rows[1][name] for name in one.attributes}
    assert {"Status", "ReqIF.ForeignCreatedBy"} <= {*one.attributes}
    assert (new.id, new.attributes) == ("NEW-1", {"Owner": "me & you"})
    # Without the original, words are kept, if not their types.
    sh.export_requirements(scenario, tmp_path / "new.reqif")
    again = scenario_of(tmp_path, "again.reqif", (tmp_path / "new.reqif").read_bytes()).table.requirement
    assert again == [heading, one, new]
    (tmp_path / "own.toml").write_text(BASE.format("spec.reqif"), encoding="utf-8")
    starhold("export", "requirements", "own.toml", "-o", "o.reqif", "--original", "spec.reqif", cwd=tmp_path, code=0)
    complains(starhold("export", "requirements", "own.toml", "-o", "o.reqif", cwd=tmp_path), "already there")
    complains(starhold("export", "requirements", "own.toml", "-o", "o.txt", cwd=tmp_path), ".csv or .reqif")
    with refused("it is not plain text"):
        reqif.written([keyed[1] | {"ReqIF.Text": "other", "text": "other"}], "t", data, "x")
