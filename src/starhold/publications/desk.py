"""Measures ask for scenarios, and for what was flown, drawn or proved of them; each is made once for a publication."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starhold.publications.paper import scenario_files
from starhold.scenario.reading import builtin_text, parse
from starhold.studies import compare as studies
from starhold.studies.body import study_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from starhold.campaign.results import CampaignResult
    from starhold.certification.certificate import Certificate
    from starhold.scenario.reading import Scenario
    from starhold.simulation.lane import Recording
    from starhold.studies.flight import Flight


class Desk:
    """The scenarios of one publication by name: its own files first, then the built-in ones; `changes` are those of a
    scenario's `with_`."""

    def __init__(self, letter: str) -> None:
        self.letter = letter
        self.used: dict[str, str] = {}
        """The texts of the scenario files that were asked for."""
        self._made: dict[Any, Any] = {}

    @cached_property
    def _files(self) -> dict[str, str]:
        return scenario_files(self.letter)

    @cached_property
    def _folder(self) -> Path:
        folder = tempfile.mkdtemp(prefix="starhold-reproduce-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        return Path(folder)

    def once(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Return what `make` gives, made at the first time that this key is asked for."""
        told = repr(key)
        if told not in self._made:
            self._made[told] = make()
        return self._made[told]

    def scenario(self, file: str, changes: Mapping[str, Any] | None = None) -> Scenario:
        """A scenario, with changes."""

        def make() -> Scenario:
            text = self._files[file] if file in self._files else builtin_text(file)
            self.used[file] = text
            read = parse(text, f"{file}.toml")
            return read.with_(changes) if changes else read

        return self.once(("scenario", file, changes), make)

    def flight(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Flight:
        """A law's flight, measured."""

        def make() -> Flight:
            scenario = self.scenario(file, changes)
            entry = scenario.pick(law)
            return studies.fly_law(scenario, entry, studies.build(scenario, entry))

        return self.once(("flight", file, law, changes), make)

    def recording(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Recording:
        """The recording of a law's flight."""
        return self.flight(file, law, changes).recording

    def certificate(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Certificate:
        """The certificate of a law as the flight starts, not tried by flights."""

        def make() -> Certificate:
            scenario = self.scenario(file, changes)
            entry = scenario.pick(law)
            return study_of(scenario.body).certify(scenario, entry, studies.build(scenario, entry))[0].certificate

        return self.once(("certificate", file, law, changes), make)

    def campaign(self, file: str) -> CampaignResult:
        """The campaign of a scenario file, its store in a folder that goes with this desk."""

        def make() -> CampaignResult:
            from starhold.campaign.campaign import Options, fly_campaign
            from starhold.campaign.engines import engine_of

            options = Options(engine_of(None, None, None), False, True, False, False)
            return fly_campaign(self.scenario(file), self._folder / file, None, options, None)

        return self.once(("campaign", file), make)
