"""A scenario that commands are quick with."""

from starhold.scenario.reading import builtin_text

SHORT = builtin_text("three-laws").replace("duration = 2000.0", "duration = 20.0")
