"""The worlds that the evidence is flown in, each as drawn, under a low sun, and in haze."""

from __future__ import annotations

import importlib
import itertools
import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from service.flight_evaluation import wires
from uavdepth.errors import SceneError
from uavdepth.scenes import SCENE_NAMES, Scene
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.heap import trim_heap

WIRES = "wires"
DEFAULT_SCENES = ("mountain", "city", "forest", "wall", WIRES)
KNOWN_SCENES = (*SCENE_NAMES, WIRES)

FIRST_TEST_SEED = 1000
"""No network is trained on, or chosen by, worlds of this seed or above."""

_FIRST_FLOWN_TEST_SEED = FIRST_TEST_SEED + 100

_FIRST_FLOWN_VALIDATION_SEED = 950
"""Seeds 900 to 999 are for choices, of networks and of settings; those below this for single pictures."""

_LOW_SUN_ELEVATION_DEG = 8.0
_LOW_SUN_BGR, _LOW_AMBIENT_BGR = (0.55, 0.82, 1.15), (0.40, 0.35, 0.33)
_HAZE_PER_M = 0.03
"""At 100 m a thing keeps 5 % of its own colour: meteorologists call 1 km of sight haze or mist."""


class Light(StrEnum):
    """Sun and air of a world."""

    AS_DRAWN = "as drawn"
    LOW_SUN = "low sun"
    HAZE = "haze"


@dataclass(frozen=True)
class WorldSpec:
    """One world.

    Args:
        name: one of `KNOWN_SCENES`.
        seed: variant.
        light: what is changed of its weather.
    """

    name: str
    seed: int
    light: Light = Light.AS_DRAWN

    def load(self) -> Scene:
        """Build it; takes some seconds.

        Raises:
            SceneError: an unknown name, or the packages of the extra `sim` are missing.
        """
        if self.name not in KNOWN_SCENES:
            raise SceneError(f"no scene is called {self.name!r}; there are {', '.join(KNOWN_SCENES)}")
        module = wires if self.name == WIRES else importlib.import_module(f"uavdepth.scenes.{self.name}")
        scene = Scene(self.name, self.seed, lit(module.build(self.seed), self.light))
        trim_heap()
        return scene


def lit(description: SceneDescription, light: Light) -> SceneDescription:
    """The same world in another light."""
    if light is Light.LOW_SUN:
        azimuth = math.atan2(description.sun_direction_ned[1], description.sun_direction_ned[0])
        high = math.radians(_LOW_SUN_ELEVATION_DEG)
        sun = np.array(
            [math.cos(azimuth) * math.cos(high), math.sin(azimuth) * math.cos(high), -math.sin(high)]
        )
        return replace(description, sun_direction_ned=sun, sun_bgr=_LOW_SUN_BGR, ambient_bgr=_LOW_AMBIENT_BGR)
    if light is Light.HAZE:
        return replace(description, haze_per_m=_HAZE_PER_M)
    return description


def specs_of(name: str, validation: bool = False, count: int = len(Light)) -> tuple[WorldSpec, ...]:
    """The test worlds of one scene, or its validation worlds: each another seed, in the lights by turns.

    Raises:
        ValueError: more validation worlds than there are seeds before those of tests.
    """
    first = _FIRST_FLOWN_VALIDATION_SEED if validation else _FIRST_FLOWN_TEST_SEED
    if validation and first + count > FIRST_TEST_SEED:
        raise ValueError(f"{count} validation worlds: there are {FIRST_TEST_SEED - first}")
    lights = itertools.cycle(Light)
    return tuple(WorldSpec(name, first + number, next(lights)) for number in range(count))
