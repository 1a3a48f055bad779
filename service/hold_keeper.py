"""Holds on loss: of all cameras and of each one, asked of the autopilot and told to the pilot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import structlog

from service.autopilot.hold_request import HoldOutcome
from service.autopilot.link_status import LinkStatus
from service.health import SEVERITY_CRITICAL, Vitals
from service.hold_on_loss import HoldOnLoss, Moment, Sight
from service.link import Link
from service.side_watch import SideLoss
from service.status import speed_mps
from service.trouble import Trouble

log = structlog.get_logger()


class HoldKeeper:
    """Asks the vehicle to hold where distances are lost, those of all directions or one camera's.

    Args:
        link: the autopilot link.
        sights: of the further cameras, by name.
    """

    def __init__(self, link: Link, sights: Mapping[str, Sight]) -> None:
        self._link = link
        self._all = HoldOnLoss()
        self._sides = {name: HoldOnLoss(sight) for name, sight in sights.items()}
        self._told: HoldOutcome | None = None
        self._mode = ""

    def hear(
        self, vitals: Vitals, trouble: Trouble | None, link: LinkStatus, sides: Mapping[str, SideLoss]
    ) -> None:
        """Judge the moment; to be called several times a second.

        Args:
            vitals: of the main camera's way.
            trouble: why no distances are sent, None if they are.
            link: the autopilot link's state.
            sides: what the further cameras lack; they are judged while distances are sent without them.
        """
        moment = Moment(
            vitals.now_ns,
            trouble,
            vitals.sent_ns,
            vitals.protected,
            link.connected,
            link.armed,
            link.autopilot,
            link.mode,
            self._link.newest_pose(),
        )
        if self._all.hear(moment):
            self._ask(self._all, moment)
        elif trouble is None or link.armed is False:  # disarmed, each begins anew
            for name, loss in sides.items():
                given = replace(vitals, sent_ns=loss.sent_ns)
                of_side = replace(
                    moment, trouble=loss.trouble, sent_ns=loss.sent_ns, protected=given.protected
                )
                if self._sides[name].hear(of_side):
                    self._ask(self._sides[name], of_side, camera=name)
                    break
        self._tell(link.hold)

    def _ask(self, on_loss: HoldOnLoss, moment: Moment, **which: str) -> None:
        self._mode = self._link.hold()
        if not self._mode:
            self._link.say(SEVERITY_CRITICAL, "uavdepth: knows no mode that stops this vehicle")
        log.warning(
            "wants the vehicle to hold",
            mode=self._mode,
            because=moment.trouble and moment.trouble.value,
            flown_in=moment.mode,
            speed_mps=speed_mps(moment.pose),
            way_m=round(on_loss.way_m, 2),
            **which,
        )

    def _tell(self, outcome: HoldOutcome | None) -> None:
        """What became of the request, once for each change."""
        if outcome is self._told:
            return
        was_asked, self._told = self._told is HoldOutcome.ASKED, outcome
        if outcome is HoldOutcome.ASKED or (outcome is HoldOutcome.GRANTED and not was_asked):
            self._link.say(SEVERITY_CRITICAL, f"uavdepth: asks for {self._mode}")
        if outcome in (HoldOutcome.REFUSED, HoldOutcome.UNANSWERED):
            self._link.say(SEVERITY_CRITICAL, f"uavdepth: hold {outcome.value}, fly by hand")
        if outcome is not None:
            log.info("request to hold", outcome=outcome.value)
