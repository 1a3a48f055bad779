"""Rendered worlds with exact depth, by name and seed (optional extra `sim`)."""

from __future__ import annotations

import importlib

from uavdepth.errors import SceneError
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.heap import trim_heap
from uavdepth.scenes.picture import RenderedPicture
from uavdepth.scenes.scene import Scene

SCENE_NAMES = ("mountain", "city", "wall", "forest", "park", "suburb", "farm", "works")
"""Worlds that `load_scene` knows; each is the module of that name in this package."""

HELD_OUT_SCENES = ("works",)
"""Worlds that no training sees: they show how a network copes with a kind of place that is new to it."""

__all__ = ["HELD_OUT_SCENES", "SCENE_NAMES", "RenderedPicture", "Scene", "load_scene", "parse_scene"]


def load_scene(name: str, seed: int = 0) -> Scene:
    """Build one world.

    Args:
        name: one of `SCENE_NAMES`.
        seed: variant, 0 or above; each looks different.

    Returns:
        The loaded scene. Building takes a few seconds.

    Raises:
        SceneError: an unknown name, a negative seed, or embreex or numba not installed.
    """
    if name not in SCENE_NAMES:
        raise SceneError(f"no scene is called {name!r}; there are {', '.join(SCENE_NAMES)}")
    if seed < 0:
        raise SceneError(f"scene seed is {seed}: 0 or above is needed")
    module = importlib.import_module(f"uavdepth.scenes.{name}")
    description: SceneDescription = module.build(seed)
    scene = Scene(name, seed, description)
    del description
    trim_heap()
    return scene


def parse_scene(spec: str) -> tuple[str, int]:
    """Name and seed of a text such as "city:3" or "wall" (seed 0).

    Raises:
        SceneError: an unknown name, or a seed that is not a whole number from 0.
    """
    name, separator, seed = spec.partition(":")
    if name not in SCENE_NAMES:
        raise SceneError(f"no scene is called {name!r} in {spec!r}; there are {', '.join(SCENE_NAMES)}")
    if not separator:
        return name, 0
    if not (seed.isascii() and seed.isdigit()):
        raise SceneError(f"scene seed {seed!r} in {spec!r} is not a whole number from 0")
    return name, int(seed)
