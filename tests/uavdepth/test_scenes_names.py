"""Scenes by name: what is accepted, what is refused and how that reads."""

from __future__ import annotations

import importlib
import sys

import pytest

from uavdepth.errors import SceneError
from uavdepth.scenes import SCENE_NAMES, Scene, load_scene, parse_scene


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("city", ("city", 0)),
        ("city:3", ("city", 3)),
        ("mountain:0", ("mountain", 0)),
        ("wall:12", ("wall", 12)),
    ],
)
def test_a_spec_is_a_name_and_a_seed(spec: str, expected: tuple[str, int]) -> None:
    assert parse_scene(spec) == expected


@pytest.mark.parametrize(
    "spec", ["moon", "", "City", "city:", "city:-1", "city:x", "city:1.5", "wall:1:2", "wall:²"]
)
def test_a_malformed_spec_is_refused_with_its_text(spec: str) -> None:
    with pytest.raises(SceneError) as refusal:
        parse_scene(spec)
    assert repr(spec) in str(refusal.value)


def test_an_unknown_scene_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(SceneError, match=r"moon.*mountain, city, wall, forest"):
        load_scene("moon")


def test_a_negative_seed_is_refused_with_its_value() -> None:
    with pytest.raises(SceneError, match="-2"):
        load_scene("city", -2)


def test_every_name_is_a_scene_that_can_be_built() -> None:
    for name in SCENE_NAMES:
        assert callable(importlib.import_module(f"uavdepth.scenes.{name}").build)


@pytest.mark.parametrize("package", ["embreex", "numba"])
def test_a_missing_package_is_named_with_the_extra_that_brings_it(
    package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # makes `import` raise as if it were not installed
    description = importlib.import_module("uavdepth.scenes.wall").build(0)
    with pytest.raises(SceneError, match=rf"{package}.*pip install 'uavdepth\[sim\]'"):
        Scene("wall", 0, description)
