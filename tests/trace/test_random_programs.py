"""Random programs leave the same bits on every machine."""

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.tiers import fewer
from tests.trace.machines import MACHINES, agree, need
from tests.trace.scripts import Script, scripts, subject, values

seeds = st.integers(0, 2**64 - 1)
# A batch is compiled at once; to make one smaller again and again would take minutes.
batches = settings(
    max_examples=fewer(5), phases=[Phase.generate], suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


@pytest.mark.parametrize("machine", MACHINES)
def test_every_machine_leaves_the_bits_of_plain_python(machine: str) -> None:
    need(machine)

    @batches
    @given(st.lists(st.tuples(scripts, seeds, st.integers(0, 3)), min_size=8, max_size=8))
    def compare(drawn: list[tuple[Script, int, int]]) -> None:
        agree(machine, *((subject(s), values(seed), {"count": count, "seed": seed}) for s, seed, count in drawn))

    compare()
