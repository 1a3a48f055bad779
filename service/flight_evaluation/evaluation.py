"""Flies everything that a plan asks for, world after world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from service.fake_autopilot.autopilot import Flavor
from service.flight_evaluation.closed_loop import Flown, fly_route
from service.flight_evaluation.configuration import settings_for
from service.flight_evaluation.plan import EvaluationPlan
from service.flight_evaluation.poses import trajectory
from service.flight_evaluation.routes import Route, find_approaches, find_corridors, find_viewpoints
from service.flight_evaluation.sight import DepthKind, Eyes
from service.flight_evaluation.survey import Looked, Surveyor
from service.flight_evaluation.turning import bearing_errors_deg
from service.flight_evaluation.worlds import WorldSpec, specs_of
from service.settings import Settings
from uavdepth.scenes import Scene

FLAVORS: tuple[Flavor, ...] = ("ardupilot", "px4")
_TURN_SHARES = (1.0, 0.5)


@dataclass
class Evidence:
    """What came of one scene with one kind of depth.

    Args:
        scene: its name.
        kind: whose depth.
        poses, looked: the open part: random poses, and pictures of flights.
        bearing_errors_deg: in turns, of messages as they arrived.
        approaches, corridors: the closed loop.
        flights: flown in the open part so far.
    """

    scene: str
    kind: DepthKind
    poses: list[Looked] = field(default_factory=list)
    looked: list[Looked] = field(default_factory=list)
    bearing_errors_deg: list[float] = field(default_factory=list)
    approaches: list[Flown] = field(default_factory=list)
    corridors: list[Flown] = field(default_factory=list)
    flights: int = 0


@dataclass(frozen=True)
class Step:
    """What is being done.

    Args:
        text: in words.
        share: of the whole evaluation that it takes, all steps together 1.
    """

    text: str
    share: float


class Evaluation:
    """One run of a plan.

    Args:
        plan: how much is flown.

    Raises:
        ConfigError: the network cannot be used.
        SceneError: a scene is unknown, or the extra `sim` is missing.
    """

    def __init__(self, plan: EvaluationPlan) -> None:
        self.plan = plan
        self.settings: Settings = settings_for(plan.model, plan.sigma_factor)
        self.evidence = {kind: {name: Evidence(name, kind) for name in plan.scenes} for kind in plan.kinds}
        if DepthKind.NETWORK in plan.kinds:
            Eyes(self.settings, DepthKind.NETWORK)  # a wrong network is told at once, not after minutes
        self._flown = 0

    def run(self) -> Iterator[Step]:
        """Do it; each step is told when it is done."""
        plan = self.plan
        approaches, corridors = plan.shared(plan.approaches), plan.shared(plan.corridors)
        worlds = len(plan.scenes) * plan.worlds
        for name, approach_count, corridor_count in zip(plan.scenes, approaches, corridors, strict=True):
            specs = specs_of(name, plan.validation, plan.worlds)
            missing = [0, 0]
            counts = zip(
                specs, plan.by_world(plan.poses), plan.by_world(plan.flights), plan.by_world(approach_count),
                plan.by_world(corridor_count), plan.by_world(plan.turns), strict=True,
            )  # fmt: skip
            for spec, poses, flights, approach, corridor, turns in counts:
                scene = spec.load()
                # What one world does not offer is looked for in the next.
                ways = find_approaches(scene, plan.seed, approach + missing[0])
                free = find_corridors(scene, plan.seed, corridor + missing[1])
                missing = [approach + missing[0] - len(ways), corridor + missing[1] - len(free)]
                places = find_viewpoints(scene, plan.seed, turns)
                for kind in plan.kinds:
                    evidence = self.evidence[kind][name]
                    parts = (
                        self._open(evidence, spec, scene, poses, flights),
                        self._turns(evidence, scene, places),
                        self._approaches(evidence, scene, ways),
                        self._corridors(evidence, scene, free),
                    )
                    for part in parts:
                        for text in part:
                            yield Step(f"{spec.name} {spec.light}, {kind} depth: {text}", 0.0)
                yield Step(f"{spec.name} {spec.light}", 1.0 / worlds)

    def _open(
        self, evidence: Evidence, spec: WorldSpec, scene: Scene, poses: int, flights: int
    ) -> Iterator[str]:
        plan = self.plan
        surveyor = Surveyor(spec, scene, self.settings, evidence.kind)
        if evidence.kind is DepthKind.TRUE:
            yield "random poses"
            evidence.poses += surveyor.poses(plan.seed, poses)
        row = plan.seed + plan.scenes.index(spec.name)
        for _ in range(flights):
            flight = trajectory(scene, row, evidence.flights, plan.flight_s)
            evidence.flights += 1
            yield f"{flight.manoeuvre}"
            evidence.looked += surveyor.flight(flight)

    def _turns(self, evidence: Evidence, scene: Scene, places: list[Route]) -> Iterator[str]:
        for number, place in enumerate(places):
            yield "turning on the spot"
            evidence.bearing_errors_deg += bearing_errors_deg(
                scene,
                self.settings,
                self._next_flavor(),
                Eyes(self.settings, evidence.kind),
                place,
                self.plan.latency_s,
                _TURN_SHARES[number % len(_TURN_SHARES)],
            )

    def _approaches(self, evidence: Evidence, scene: Scene, ways: list[Route]) -> Iterator[str]:
        for route in ways:
            for flavor in FLAVORS:
                yield f"approach, {flavor}"
                eyes = Eyes(self.settings, evidence.kind)
                evidence.approaches.append(
                    fly_route(scene, self.settings, flavor, eyes, route, self.plan.latency_s)
                )

    def _corridors(self, evidence: Evidence, scene: Scene, free: list[Route]) -> Iterator[str]:
        for route in free:
            flavor = self._next_flavor()
            yield f"corridor, {flavor}"
            eyes = Eyes(self.settings, evidence.kind)
            evidence.corridors.append(
                fly_route(scene, self.settings, flavor, eyes, route, self.plan.latency_s, corridor=True)
            )

    def _next_flavor(self) -> Flavor:
        self._flown += 1
        return FLAVORS[self._flown % len(FLAVORS)]
