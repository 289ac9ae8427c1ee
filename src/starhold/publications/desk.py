"""The scenarios, flights, figures and proofs that measures use; each is made once per publication."""

import shutil
import tempfile
import weakref
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from starhold.campaign.results import CampaignResult
from starhold.certification.certificate import Claim
from starhold.loop.closed_loop import ClosedLoop
from starhold.publications.paper import scenario_files
from starhold.scenario.reading import Scenario, builtin_text, parse
from starhold.simulation.lane import Recording
from starhold.studies import compare as studies
from starhold.studies.body import Issued, study_of
from starhold.studies.flight import Flight


class Desk:
    """The scenarios of one publication by name: its own files first, then the built-in ones; `changes` are as for
    `Scenario.with_`."""

    def __init__(self, letter: str) -> None:
        self.letter = letter
        self.used: dict[str, str] = {}
        """The texts of the scenario files used so far, by name."""
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
        """Return the result of `make`, which is called only at the first request for this key."""
        name = repr(key)
        if name not in self._made:
            self._made[name] = make()
        return self._made[name]

    def scenario(self, file: str, changes: Mapping[str, Any] | None = None) -> Scenario:
        """Return a scenario with changes."""

        def make() -> Scenario:
            text = self._files[file] if file in self._files else builtin_text(file)
            self.used[file] = text
            read = parse(text, f"{file}.toml")
            return read.with_(changes) if changes else read

        return self.once(("scenario", file, changes), make)

    def flight(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Flight:
        """Return a law's flight with its metrics."""

        def make() -> Flight:
            scenario = self.scenario(file, changes)
            return studies.fly_law(scenario, scenario.pick(law), self.loop(file, law, changes))

        return self.once(("flight", file, law, changes), make)

    def loop(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> ClosedLoop:
        """Return a law's closed loop."""
        scenario = self.scenario(file, changes)
        return studies.build(scenario, scenario.pick(law))

    def recording(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Recording:
        """Return the recording of a law's flight."""
        return self.flight(file, law, changes).recording

    def certificates(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> Sequence[Issued]:
        """Return the certificates of a law, beginning with that of the initial loop, not tested by flights."""
        scenario = self.scenario(file, changes)
        certify, loop = study_of(scenario.body).certify, self.loop(file, law, changes)
        return self.once(("certificates", file, law, changes), lambda: certify(scenario, scenario.pick(law), loop))

    def claims(self, file: str, law: str, changes: Mapping[str, Any] | None = None) -> dict[str, Claim]:
        """Return the claims about a law's initial loop, by kind."""
        return {claim.kind: claim for claim in self.certificates(file, law, changes)[0].certificate.claims}

    def campaign(self, file: str) -> CampaignResult:
        """Return the campaign of a scenario file, stored in a folder that is removed with this desk."""

        def make() -> CampaignResult:
            from starhold.campaign.campaign import Options, fly_campaign
            from starhold.campaign.engines import engine_of

            options = Options(engine_of(None, None, None), False, True, False, False)
            return fly_campaign(self.scenario(file), self._folder / file, None, options, None)

        return self.once(("campaign", file), make)
