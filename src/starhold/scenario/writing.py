"""Laws back to TOML."""

from __future__ import annotations

import json
from typing import Any

from starhold.laws.catalogue import Law

_BODY = """\
name = "written"
[spacecraft]
inertia = [2.0, 3.0, 4.0]
torque_limit = 0.05
[simulation]
duration = 1.0
control_period = 0.1
"""


def law_table(law: Law, gains: Any) -> str:
    """A [[law]] table with these gains, exact: floats are written so that they read back as the same numbers."""
    which = f'type = "{law.name}"' if law.file is None else f"file = {json.dumps(str(law.file))}"
    lines = ["[[law]]", which]
    for item, value in zip(law.fields(), gains, strict=True):
        shown = item.gain.choices[value] if item.gain.choices else value
        # JSON's strings, integers, finite floats and arrays are TOML's too.
        lines.append(f"{item.name} = {json.dumps(shown, allow_nan=False)}")
    return "\n".join(lines) + "\n"


_POINT = """\
name = "written"
[libration]
[control]
limit = 4.0
[initial]
position = [0.0, 0.5, 0.1]
[simulation]
duration = 0.1
"""


def station_scenario_with(law: Law, gains: Any) -> str:
    """A small scenario of station keeping that holds one law."""
    return _POINT + law_table(law, gains)


def scenario_with(law: Law, gains: Any) -> str:
    """A small scenario that holds one law."""
    return _BODY + law_table(law, gains)
