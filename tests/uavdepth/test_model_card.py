"""A card that is whole is read; one that is not is refused by the name of the key."""

from __future__ import annotations

import json
import math

import pytest
from onnx_files import card_values

from uavdepth import ModelCard, ModelCardError

REQUIRED = sorted(card_values())


def test_a_whole_card_is_read_and_written_without_loss():
    card = ModelCard.from_json(json.dumps(card_values()), "a.onnx")
    assert card.input_width == 48
    assert card.measured == {"abs_rel": 0.1}
    assert ModelCard.from_json(card.to_json(), "a.onnx") == card


@pytest.mark.parametrize("key", REQUIRED)
def test_each_missing_key_is_named_with_the_file(key):
    with pytest.raises(ModelCardError, match=rf"a\.onnx: the model card lacks the key '{key}'"):
        ModelCard.from_json(json.dumps(card_values(**{key: None})), "a.onnx")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("card_version", 3),
        ("input_width", 0),
        ("input_width", 384.5),
        ("input_height", "192"),
        ("mean", [0.5, 0.5]),
        ("std", [0.2, 0.2, 0.0]),
        ("std", [0.2, 0.2, math.nan]),
        ("output", "disparity"),
        ("metric", "yes"),
        ("uncertainty", 1),
        ("focal_px", 0),
        ("focal_px", math.inf),
        ("max_depth_m", -1),
        ("name", ""),
        ("measured", [1]),
    ],
)
def test_each_impossible_value_is_named(key, value):
    with pytest.raises(ModelCardError, match=f"key '{key}"):
        ModelCard.from_json(json.dumps(card_values(**{key: value})), "a.onnx")


def test_an_unknown_key_is_named():
    with pytest.raises(ModelCardError, match="unknown key 'focal_length'"):
        ModelCard.from_json(json.dumps(card_values(focal_length=3)), "a.onnx")


@pytest.mark.parametrize("text", ["", "{", "[]", "3", b"\xff\xfe", "null"])
def test_what_is_no_card_at_all_is_refused_with_the_file(text):
    with pytest.raises(ModelCardError, match=r"a\.onnx: the model card cannot be read"):
        ModelCard.from_json(text, "a.onnx")
