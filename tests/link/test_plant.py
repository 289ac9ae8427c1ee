"""A plant heeds what is valid, counts what is not, and keeps to a clock, which here is a number."""

from dataclasses import replace

import numpy as np
import pytest

import starhold as sh
from starhold.link.plant import Ending, Missing, Plant, Rules, status, summary
from starhold.link.protocol import Decoder, Fault, Kind, Message, binary, line
from starhold.simulation.stepper import Stepper
from tests.export.flown import loop_of
from tests.link.clients import mutated
from tests.tiers import WHOLE

PUSH = (1e-3, 0.0, 0.0)


class Desk:
    """A plant, its clock, and what it said."""

    def __init__(self, steps=50, rate=None, missing=Missing.HOLD, hello=True, text=False):
        self.now, self.sent, self.write = 0.0, [], line if text else binary
        self.plant = Plant(sh.stepper("three-laws"), {}, Rules(steps, rate, missing), lambda: self.now)
        self.decoder, answers = Decoder(), Decoder(by_plant=True)
        self.plant.send = lambda data: self.sent.extend(answers.feed(data))
        if hello:
            self.tell(Kind.HELLO)

    def tell(self, kind, step=0, numbers=()):
        """What the plant says to a message."""
        return self.receive(self.write(Message(kind, step, numbers)))

    def receive(self, data, datagram=False):
        self.sent.clear()
        if datagram:
            self.plant.datagram(data)
        else:
            self.plant.received(data, self.decoder)
        return list(self.sent)

    def tick_at(self, now):
        """What the plant says when its period ends, which must be at this time."""
        assert self.plant.due == pytest.approx(now)
        self.now = now
        self.sent.clear()
        self.plant.tick()
        return list(self.sent)

    @property
    def torques(self):
        return self.plant.flight.recording()["command"][:, 0].tolist()


def test_a_command_moves_the_plant_once():
    desk = Desk()
    (readings,) = desk.tell(Kind.COMMAND, 0, PUSH)
    assert (readings.kind, readings.step) == (Kind.READINGS, 1)
    # Again, as after readings that were lost: the same readings, and no step.
    assert desk.tell(Kind.COMMAND, 0, PUSH) == [readings]
    assert desk.plant.flight.steps == 1
    for step, fault in ((2, Fault.ORDER), (2**32 - 1, Fault.ORDER)):
        assert desk.tell(Kind.COMMAND, step, PUSH) == [Message(Kind.REFUSED, 1, (), fault)]
    desk.tell(Kind.COMMAND, 1, PUSH)
    assert desk.tell(Kind.COMMAND, 0, PUSH) == [Message(Kind.REFUSED, 2, (), Fault.LATE)]
    assert desk.plant.faults == {Fault.DOUBLED: 1, Fault.ORDER: 2, Fault.LATE: 1}
    assert "Messages not heeded: 1 doubled, 1 late, 2 out of order." in summary(desk.plant)


def test_nobody_commands_before_a_hello():
    desk = Desk(hello=False)
    assert desk.tell(Kind.COMMAND, 0, PUSH) == [Message(Kind.REFUSED, 0, (), Fault.ORDER)]
    assert desk.plant.flight.steps == 0
    assert [one.kind for one in desk.tell(Kind.HELLO)] == [Kind.HELLO, Kind.READINGS]


def test_reset_begins_again():
    desk = Desk()
    first = desk.tell(Kind.HELLO)[1]
    desk.tell(Kind.COMMAND, 0, PUSH)
    assert desk.tell(Kind.RESET) == [first]
    assert desk.tell(Kind.RESET, 0, (5.0, 2.0))[0].step == 0
    assert (desk.plant.flight.seed, desk.plant.flight.run) == (5, 2)
    for wrong in ((0.5, 1.0), (2.0**53, 0.0), (1.0,)):
        assert desk.tell(Kind.RESET, 0, wrong)[-1].text == Fault.MALFORMED


def test_the_flight_ends_with_the_command_after_its_last_step():
    desk = Desk(steps=2)
    desk.tell(Kind.COMMAND, 0, PUSH)
    assert desk.tell(Kind.COMMAND, 1, (0.0, 0.0, 0.0))[0].step == 2
    assert desk.tell(Kind.COMMAND, 2, (2e-3, 0.0, 0.0)) == [Message(Kind.STOP, 2, (), Ending.FLOWN)]
    assert desk.torques == [1e-3, 0.0, 2e-3]
    assert desk.tell(Kind.COMMAND, 3, PUSH) == []


def test_a_motion_that_diverges_ends_the_flight():
    loop = replace(loop_of("lyapunov"), limit="none")
    plant, sent, answers = Plant(Stepper(loop), {}, Rules(50)), [], Decoder(by_plant=True)
    plant.send = lambda data: sent.extend(answers.feed(data))
    decoder = Decoder()
    plant.received(binary(Message(Kind.HELLO)), decoder)
    while plant.ending is None:
        plant.received(binary(Message(Kind.COMMAND, plant.flight.steps, (1e9, 0.0, 0.0))), decoder)
    assert plant.ending is Ending.DIVERGED
    assert sent[-1] == Message(Kind.STOP, plant.flight.steps, (), Ending.DIVERGED)
    assert plant.flight.recording().attrs["diverged_at"] == plant.flight.time


def test_stop_ends_the_flight():
    desk = Desk()
    desk.tell(Kind.COMMAND, 0, PUSH)
    assert desk.tell(Kind.STOP) == [Message(Kind.STOP, 1, (), Ending.STOPPED)]
    assert desk.torques == [1e-3]


@pytest.mark.parametrize(("missing", "flown"), [(Missing.HOLD, [1e-3, 1e-3, 2e-3]), (Missing.ZERO, [1e-3, 0.0, 2e-3])])
def test_a_period_without_a_command(missing, flown):
    desk = Desk(rate=10.0, missing=missing)
    wall = desk.plant.flight.loop.period / 10.0
    desk.now = 0.25 * wall
    assert desk.tell(Kind.COMMAND, 0, PUSH) == []
    assert desk.tell(Kind.COMMAND, 0, (9e-3, 0.0, 0.0))[0].text == Fault.DOUBLED
    assert desk.tick_at(wall)[0].step == 1
    assert desk.tick_at(2 * wall)[0].step == 2
    desk.now = 2.25 * wall
    assert desk.tell(Kind.COMMAND, 1, (7e-3, 0.0, 0.0))[0].text == Fault.LATE
    assert desk.tell(Kind.COMMAND, 3, (7e-3, 0.0, 0.0))[0].text == Fault.ORDER
    desk.tell(Kind.COMMAND, 2, (2e-3, 0.0, 0.0))
    desk.tick_at(3 * wall)
    assert desk.torques == flown
    plant = desk.plant
    assert (plant.missed, plant.commanded, plant.behind) == (1, 2, 0.0)
    assert plant.latencies == pytest.approx([0.25 * wall, 1.25 * wall, 0.25 * wall])
    told = "\n".join(summary(plant))
    assert f"3 times: min {250 * wall:.3g} ms, median {250 * wall:.3g} ms" in told
    assert f"Real time at rate 10: 1 missed periods ({missing}), 0 of their commands never came" in told


def test_a_missing_command_may_end_the_flight():
    desk = Desk(rate=1.0, missing=Missing.STOP)
    assert desk.tick_at(desk.plant.flight.loop.period) == [Message(Kind.STOP, 0, (), Ending.MISSED)]
    assert desk.plant.due is None


def test_a_late_plant_says_how_late_and_keeps_the_schedule():
    desk = Desk(rate=1.0)
    period = desk.plant.flight.loop.period
    desk.now = 2.5 * period
    desk.plant.tick()
    assert desk.plant.behind == pytest.approx(1.5 * period)
    assert desk.plant.due == pytest.approx(2 * period)


def test_late_wakings_do_not_add_up():
    """Ten minutes at 10 Hz: each period begins late by some chance, and the last no later than that after its time."""
    rng, desk, periods = np.random.default_rng(5), Desk(steps=6000, rate=1.0), 6000
    period, plant = desk.plant.flight.loop.period, desk.plant
    late, given = rng.exponential(0.005, periods), rng.random(periods) < 0.9
    for k in range(periods):
        if given[k]:
            desk.now = k * period + 0.06
            desk.tell(Kind.COMMAND, k, PUSH)
        assert plant.due == pytest.approx((k + 1) * period, rel=1e-12)
        desk.now = plant.due + late[k]
        plant.tick()
    assert plant.flight.steps == periods
    assert plant.lateness == pytest.approx(late, abs=1e-9)
    assert plant.behind == max(plant.lateness)
    assert (plant.commanded, plant.missed) == (given.sum(), periods - given.sum())
    assert desk.now - periods * period == pytest.approx(late[-1])
    assert status(plant).startswith("Step 6000/6000: latency ")


def test_answers_have_the_form_of_the_question():
    desk = Desk(text=True)
    assert desk.sent[1].numbers == pytest.approx(desk.tell(Kind.HELLO)[1].numbers)
    replies = []
    desk.plant.send = replies.append
    desk.plant.datagram(binary(Message(Kind.HELLO)))
    assert all(reply.startswith(b"SHLK") for reply in replies)
    desk.plant.datagram(b"{ no JSON")
    assert replies[-1].startswith(b"SHLK")
    desk.plant.datagram(line(Message(Kind.HELLO)).strip())
    assert replies[-1].startswith(b"{")


@pytest.mark.parametrize("datagram", [False, True])
def test_no_malformed_message_moves_the_plant(datagram):
    rng, desk = np.random.default_rng(3), Desk(steps=10**6)
    plant = desk.plant
    valid = 0
    for _ in range(10_000 if WHOLE else 400):
        before = plant.flight.truth
        desk.receive(mutated(rng, plant.flight.steps), datagram)
        assert np.array_equal(plant.flight.truth, before)
        assert plant.ending is None
        if rng.random() < 0.1:
            # What is whole is heeded, whatever came before: of a stream from the message after the next.
            good = [line, binary][not datagram or int(rng.integers(2))]
            step = plant.flight.steps
            for _ in range(1 if datagram else 2):
                desk.receive(good(Message(Kind.COMMAND, step, PUSH)), datagram)
            assert plant.flight.steps == step + 1
            valid += 1
    assert plant.commanded == valid > 10
    assert plant.faults[Fault.MALFORMED] > 100
    assert plant.faults[Fault.NOT_FINITE] > 10
    assert plant.faults[Fault.ORDER] > 10
