"""How a vehicle is asked to stop: by its own mode, again when nothing came, and never against the pilot."""

from __future__ import annotations

import pytest
from hold_talk import S, Talk
from link_support import Conversation, Flight, Voice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.hold_request import HoldOutcome


class TestWhoFliesNow:
    """HEARTBEAT tells the mode once a second: it is asked for before anything else is."""

    def test_the_autopilot_is_asked_for_its_mode_first(self) -> None:
        talk = Talk()
        talk.talk.session.ask_to_hold()
        talk.talk.wait_s(0.1)
        assert talk.mode_requests == 1
        assert talk.commands == []
        talk.beat(5)
        talk.talk.wait_s(0.05)
        assert len(talk.commands) == 1
        assert talk.mode_requests == 1

    def test_a_pilot_who_has_taken_over_meanwhile_is_left_alone(self) -> None:
        talk = Talk()
        talk.talk.session.ask_to_hold()
        talk.talk.wait_s(0.1)
        talk.beat(2)
        talk.talk.wait_s(2.0)
        assert talk.commands == []
        assert talk.outcome is HoldOutcome.OVERRULED

    def test_an_autopilot_that_does_not_tell_is_asked_to_hold_0_2_s_later(self) -> None:
        talk = Talk()
        talk.talk.session.ask_to_hold()
        talk.talk.wait_s(0.18)
        assert talk.commands == []
        talk.talk.wait_s(0.06)
        assert len(talk.commands) == 1


class TestHowItIsAsked:
    @pytest.mark.parametrize(
        ("autopilot", "kind", "mode", "name", "command"),
        [
            (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR, 5, "BRAKE", (17, 0, 0)),
            (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_HEXAROTOR, 4, "BRAKE", (17, 0, 0)),
            (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_GROUND_ROVER, 15, "HOLD", (4, 0, 0)),
            (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR, 3 << 16, "Hold", (4, 3, 0)),
        ],
    )
    def test_each_vehicle_by_its_own_mode(
        self, autopilot: int, kind: int, mode: int, name: str, command: tuple[int, int, int]
    ) -> None:
        talk = Talk(autopilot, kind, mode)
        assert talk.ask() == name
        talk.answer(mavlink.MAV_RESULT_ACCEPTED)
        talk.talk.wait_s(2.0)
        assert talk.commands == [command]
        assert talk.outcome is HoldOutcome.GRANTED

    def test_a_vehicle_without_such_a_mode_is_not_asked(self) -> None:
        talk = Talk(kind=mavlink.MAV_TYPE_FIXED_WING)
        assert talk.talk.session.ask_to_hold() == ""
        talk.talk.wait_s(1.0)
        assert talk.commands == []
        assert talk.outcome is HoldOutcome.IMPOSSIBLE

    def test_a_lost_command_is_sent_again_twice(self) -> None:
        talk = Talk()
        talk.talk.session.ask_to_hold()
        talk.talk.wait_s(3.0)
        assert [confirmation for *_, confirmation in talk.commands] == [0, 1, 2]
        assert talk.outcome is HoldOutcome.UNANSWERED

    def test_a_refused_brake_becomes_loiter_and_a_refused_loiter_is_the_end(self) -> None:
        talk = Talk(mode=4)
        talk.ask()
        for _ in range(2):
            talk.talk.wait_s(0.1)
            talk.answer(mavlink.MAV_RESULT_FAILED)
        talk.talk.wait_s(2.0)
        assert [main for main, *_ in talk.commands] == [17, 5]
        assert talk.outcome is HoldOutcome.REFUSED

    def test_the_answer_to_another_stations_command_is_not_taken_for_ours(self) -> None:
        talk = Talk()
        talk.ask()
        talk.answer(mavlink.MAV_RESULT_FAILED, component=190)
        assert talk.outcome is HoldOutcome.ASKED

    def test_a_mode_that_somebody_else_has_chosen_ends_the_request(self) -> None:
        talk = Talk()
        talk.ask()
        talk.beat(0)
        talk.talk.wait_s(2.0)
        assert len(talk.commands) == 1
        assert talk.outcome is HoldOutcome.OVERRULED

    def test_a_granted_request_is_not_sent_again_when_the_pilot_flies_on(self) -> None:
        talk = Talk()
        talk.ask()
        talk.beat(17)
        assert talk.outcome is HoldOutcome.GRANTED
        talk.beat(5)
        talk.talk.wait_s(2.0)
        assert len(talk.commands) == 1
        assert talk.outcome is HoldOutcome.OVERRULED

    def test_what_a_broken_line_kept_back_is_not_asked_when_it_is_back(self) -> None:
        talk = Talk()
        talk.talk.session.ask_to_hold()
        talk.talk.session.line_failed("cable out")
        talk.talk.wait_s(20.0)
        talk.talk.session.line_opened(talk.talk.now_ns)
        talk.beat(5)
        talk.talk.wait_s(2.0)
        assert talk.commands == []
        assert talk.outcome is HoldOutcome.UNANSWERED

    def test_nothing_is_asked_before_an_autopilot_is_heard(self) -> None:
        talk = Conversation(S)
        assert talk.session.ask_to_hold() == ""
        Flight(talk, Voice()).fly(1.0)
        assert talk.session.status(talk.now_ns).hold is None
