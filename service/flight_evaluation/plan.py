"""How much is flown."""

from __future__ import annotations

from dataclasses import dataclass, replace

from service.flight_evaluation.sight import DepthKind
from service.flight_evaluation.worlds import DEFAULT_SCENES


@dataclass(frozen=True)
class EvaluationPlan:
    """One evaluation.

    Args:
        scenes: names of the scenes.
        kinds: whose depth; the last one's figures come first in the report.
        model: the network.
        latency_s: from exposure to the message's leaving.
        seed: of poses, flights and routes.
        poses: random poses a scene, with true depth only: a network may need the pictures before.
        flights: looked at one by one, a scene, shared among its worlds.
        flight_s: length of each.
        approaches, corridors: of all scenes together; an approach is flown by both autopilots, the corridors
            by them in turns.
        turns: flights a scene in which bearings are measured.
        worlds: worlds of each scene, in turns as drawn, under a low sun, in haze.
        sigma_factor: `[scan] sigma_factor`; None: its default.
        validation: in worlds that choices are made by, not in those of tests.
    """

    scenes: tuple[str, ...] = DEFAULT_SCENES
    kinds: tuple[DepthKind, ...] = (DepthKind.TRUE, DepthKind.NETWORK)
    model: str = "default"
    latency_s: float = 0.1
    seed: int = 1
    poses: int = 100
    flights: int = 5
    flight_s: float = 4.5
    approaches: int = 20
    corridors: int = 20
    turns: int = 2
    worlds: int = 3
    sigma_factor: float | None = None
    validation: bool = False

    def changed(
        self, approaches: int | None = None, corridors: int | None = None, poses: int | None = None
    ) -> EvaluationPlan:
        """The same with other numbers; None leaves a number as it is."""
        return replace(
            self,
            approaches=self.approaches if approaches is None else approaches,
            corridors=self.corridors if corridors is None else corridors,
            poses=self.poses if poses is None else poses,
        )

    def repeated(self, rounds: int) -> EvaluationPlan:
        """So many times as many poses, flights and turns, in so many times as many worlds."""
        return replace(
            self,
            poses=self.poses * rounds,
            flights=self.flights * rounds,
            turns=self.turns * rounds,
            worlds=self.worlds * rounds,
        )

    def shared(self, total: int) -> tuple[int, ...]:
        """A number spread over the scenes as evenly as it goes."""
        return _spread(total, len(self.scenes))

    def by_world(self, of_scene: int) -> tuple[int, ...]:
        """A scene's number spread over its worlds."""
        return _spread(of_scene, self.worlds)


def quick(plan: EvaluationPlan) -> EvaluationPlan:
    """The same in a minute or two: enough to see that everything works, not enough to judge by."""
    return replace(plan, poses=6, flights=1, flight_s=2.5, approaches=2, corridors=2, turns=1, worlds=1)


def _spread(total: int, parts: int) -> tuple[int, ...]:
    return tuple(total // parts + (number < total % parts) for number in range(parts))
