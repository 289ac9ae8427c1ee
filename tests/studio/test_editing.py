"""What the studio says of a text, and how it saves one."""

from pathlib import Path

import pytest

from starhold.scenario.reading import builtin_text
from starhold.studio import editing
from starhold.studio.checker import Documents, RefusedError


@pytest.mark.parametrize(
    ("old", "new", "at"),
    [
        ('torque_limit = "0.01 N m"', "torque_limit = -1", "torque_limit"),
        ("switching_gain = 0.005", "switching_gain = 0", "switching_gain"),
        ('limit = "axis"', "limit = axis", "limit = axis"),
        ("[orbit]", "[orbti]", "[orbti]"),
        ("inertia = [2.0, 3.0, 4.0]", "", "[spacecraft]"),
    ],
)
def test_errors_stand_at_the_key(old: str, new: str, at: str) -> None:
    text = builtin_text("three-laws").replace(old, new)
    found = editing.check(text, "file", Path())
    assert text.splitlines()[found["line"] - 1].startswith(at), found


def test_a_loop_that_is_refused_is_no_sound_scenario() -> None:
    text = builtin_text("three-laws").replace('type = "lyapunov"', 'type = "pd"\nlimit = "axis"\nk_attitude = 0.02', 1)
    text = "\n".join(line for line in text.splitlines() if not line.startswith("k_attitude = 0.009"))
    assert "needs k_attitude below the torque limit" in editing.check(text, "mine.toml", Path())["error"]


def test_a_link_and_its_rights_and_line_ends_stay(tmp_path: Path) -> None:
    real, link = tmp_path / "real.toml", tmp_path / "link.toml"
    real.write_bytes(b"a = 1\r\n")
    real.chmod(0o640)
    link.symlink_to(real)
    documents = Documents(link)
    found = documents.read()
    assert found["text"] == "a = 1\n"
    documents.save("link.toml", "a = 2\n", found["version"])
    assert link.is_symlink()
    assert real.read_bytes() == b"a = 2\r\n"
    assert real.stat().st_mode & 0o777 == 0o640
    with pytest.raises(RefusedError, match="has changed"):
        documents.save("link.toml", "a = 3\n", found["version"])
