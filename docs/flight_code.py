"""Writes the C of docs/flight-code: the laws that the page shows."""

from __future__ import annotations

from pathlib import Path

from starhold.api import export_c
from starhold.scenario.reading import Scenario, builtin_text, load, parse

LQR = """
[[law]]
type = "lqr"
form = "I"
a = 0.0
b = 0.01
gyroscopic = 1.0
"""
FOLDER = Path(__file__).parent / "flight-code"


def shown() -> dict[str, tuple[Scenario, str]]:
    """The laws by their names in C: scenario and law."""
    return {
        "lyapunov": (load("three-laws"), "lyapunov"),
        "sliding": (load("three-laws"), "sliding"),
        "lqr": (parse(builtin_text("three-laws") + LQR, "three-laws"), "lqr"),
        "modal": (load("landing"), "fit"),
        "wheel": (load("wheels-orbital"), "wheel"),
        "mpc": (load("three-laws"), "mpc"),
    }


if __name__ == "__main__":
    import tempfile

    FOLDER.mkdir(exist_ok=True)
    for name, (scenario, law) in shown().items():
        with tempfile.TemporaryDirectory() as folder:
            for file, text in export_c(scenario, folder, law, name=name).files.items():
                if file in (f"{name}.c", f"{name}.h"):
                    (FOLDER / file).write_text(str(text), encoding="utf-8")
