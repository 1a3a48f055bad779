"""The model card: what an ONNX file says about itself, and the contract between training and flight."""

from __future__ import annotations

import json
import tomllib
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from uavdepth.camera import CameraModel
from uavdepth.errors import HintError, ModelCardError
from uavdepth.model.hint_levels import hint_shapes

CARD_METADATA_KEY = "uavdepth.card"
"""Key of the ONNX metadata_props entry that holds the card as JSON."""

CARD_FILE_SUFFIX = ".toml"
"""A foreign network's card lies beside it: `FILE.onnx.toml`."""

OutputKind = Literal[
    "log_inverse_depth", "inverse_depth", "depth", "relative_inverse_depth", "affine_inverse_depth"
]
"""What the depth output holds, before the focal length is applied."""

HintName = Literal["ground", "points"]

RELATIVE_KINDS = frozenset({"relative_inverse_depth", "affine_inverse_depth"})
"""Output kinds that no focal length brings to metres."""

PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]

_FIRST_VERSION_KEYS = (
    "metric",
    "uncertainty",
    "focal_px",
    "max_depth_m",
    "training_data",
    "licence",
    "measured",
    "created",
)
"""Keys that version 1 had no defaults for."""

_SECOND_VERSION_KEYS = (
    "multiple_of",
    "channel_order",
    "layout",
    "hints",
    "ground_name",
    "points_name",
    "hint_layout",
)
"""Keys that version 1 did not have."""

_MEASURED_ENTRIES = 200


class ModelCard(BaseModel):
    """What a depth network needs and gives.

    The network's input is one picture, float32 or float16, of shape (1, 3, input_height, input_width), or
    (1, input_height, input_width, 3) where `layout` is "nhwc", as `(pixel / 255 - mean) / std`. `DepthModel`
    does that arithmetic, so a graph that normalises by itself has mean 0 and std 1. The picture is the
    camera's, stretched to the input size. Where `multiple_of` is given the size is free: see `input_size`.

    The output has the picture's rows and columns, in any size, and any number of axes of length 1 around
    them: (1, 1, H, W) and (1, H, W) alike. With `f` the camera's focal length in pixels of the network's
    width, z-depth in metres is

        log_inverse_depth:       (f / focal_px) * exp(-output)
        inverse_depth:           (f / focal_px) / output
        depth:                   (f / focal_px) * output
        relative_inverse_depth:  scale / output              scale unknown, another for each picture
        affine_inverse_depth:    1 / (scale * output + shift)   both unknown, others for each picture

    A log_inverse_depth smaller than the input is enlarged to its size, bilinear, and so is its uncertainty.

    Without `focal_px` the factor in front is 1: the output does not depend on the camera.

    The second output, where `uncertainty` is true, is log of sigma / depth, in the same layout.

    Further inputs, where `hints` names them, are float32 planes of the picture's size, made by
    `uavdepth.model.hint_planes`; all of a plane is 0 where nothing is known:

        ground:  (1, 1, H, W)  inverse depth of level ground
        points:  (1, 2, H, W)  inverse depth of measured points, and the confidence in it

    Where `hint_layout` is "levels" they are instead what `uavdepth.model.hint_levels` makes of these planes,
    with the names that it gives.

    Version 1 has fixed sizes, no hints, and output kinds of a focal length only.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")

    card_version: Literal[1, 2] = Field(description="Version of this format.")
    name: Text = Field(description="Name of the network, for status and records.")
    input_width: int = Field(ge=16, le=4096, description="Width of the network's input, pixels.")
    input_height: int = Field(ge=16, le=4096, description="Height of the network's input, pixels.")
    mean: tuple[FiniteFloat, FiniteFloat, FiniteFloat] = Field(
        description="Subtracted from the channels, red first, in 0..1."
    )
    std: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(
        description="Divides the channels after the mean."
    )
    output: OutputKind = Field(description="What the depth output holds.")
    metric: bool = Field(
        default=False, description="Depth is in metres; false: up to one unknown factor a picture."
    )
    uncertainty: bool = Field(default=False, description="There is a second output, log of relative sigma.")
    focal_px: PositiveFloat | None = Field(
        default=None, description="Focal length that the output is normalised to, pixels."
    )
    max_depth_m: PositiveFloat | None = Field(
        default=None, description="Depth beyond which the network was not trained; not for relative kinds."
    )
    training_data: Text = Field(default="unknown", description="What it was trained on.")
    effort: Text = Field(default="unknown", description="Steps, pictures and hours of its training.")
    licence: Text = Field(default="unknown", description="Licence of the weights.")
    intended_use: Text = Field(default="unknown", description="What it was made for.")
    limits: Text = Field(default="unknown", description="What it cannot do, or nobody has tried.")
    measured: dict[str, JsonValue] = Field(
        default_factory=dict, description="Errors measured on data it was not trained on."
    )
    created: Text = Field(default="unknown", description="When it was exported, ISO 8601.")
    multiple_of: int | None = Field(
        default=None, ge=1, le=256, description="The size is free, width and height multiples of this."
    )
    channel_order: Literal["rgb", "bgr"] = Field(default="rgb", description="Order of the input's channels.")
    layout: Literal["nchw", "nhwc"] = Field(default="nchw", description="Order of the input's axes.")
    hints: tuple[HintName, ...] = Field(default=(), description="Hints that the network takes.")
    hint_layout: Literal["planes", "levels"] = Field(
        default="planes", description="Hints are planes of the picture's size, or their levels."
    )
    input_name: Text = Field(default="image", description="Name of the network's input.")
    ground_name: Text = Field(default="ground", description="Name of the ground hint's input.")
    points_name: Text = Field(default="points", description="Name of the point hints' input.")
    output_name: Text = Field(default="log_inverse_depth", description="Name of the depth output.")
    uncertainty_name: Text = Field(default="log_sigma", description="Name of the uncertainty output.")

    @field_validator("measured")
    @classmethod
    def _measured_is_not_huge(cls, value: dict[str, JsonValue]) -> dict[str, JsonValue]:
        if len(value) > _MEASURED_ENTRIES:
            raise ValueError(f"{len(value)} entries: at most {_MEASURED_ENTRIES} are read")
        return value

    @model_validator(mode="after")
    def _keys_fit_together(self) -> Self:
        complaints = [
            *self._complaints_of_version(),
            *self._complaints_of_kind(),
            *self._complaints_of_hints(),
        ]
        if complaints:
            raise PydanticCustomError("keys", "{text}", {"text": "\n".join(complaints)})
        return self

    def _complaints_of_version(self) -> list[str]:
        if self.card_version != 1:
            return []
        lacking = [key for key in _FIRST_VERSION_KEYS if getattr(self, key) is None or key not in self._given]
        newer = [key for key in _SECOND_VERSION_KEYS if key in self._given]
        complaints = [f"the model card lacks the key '{key}'" for key in lacking]
        complaints += [f"the model card's key '{key}' needs card_version = 2" for key in newer]
        if self.output in RELATIVE_KINDS:
            complaints.append(f"the model card's key 'output' is '{self.output}': it needs card_version = 2")
        return complaints

    def _complaints_of_kind(self) -> list[str]:
        if self.output in RELATIVE_KINDS:
            wrong = [key for key in ("focal_px", "max_depth_m") if getattr(self, key) is not None]
            complaints = [f"the model card's key '{key}' means nothing for '{self.output}'" for key in wrong]
            if self.metric:
                complaints.append(f"the model card's key 'metric' is true: '{self.output}' has no metres")
            return complaints
        complaints = []
        if self.card_version > 1:
            if "metric" not in self._given:
                complaints.append(f"the model card lacks the key 'metric': is '{self.output}' in metres?")
            if self.max_depth_m is None:
                complaints.append("the model card lacks the key 'max_depth_m': where does its depth end?")
        return complaints

    def _complaints_of_hints(self) -> list[str]:
        complaints = self._complaints_of_levels() if self.hint_layout == "levels" else []
        if not self.hints:
            return complaints
        if len(set(self.hints)) != len(self.hints):
            complaints.append(f"the model card's key 'hints' names one twice: {list(self.hints)}")
        # Planes are in the unit of the output, and only who knows metres can tell them from the planes.
        needed = {"focal_px": self.focal_px, "metric": self.metric, "uncertainty": self.uncertainty}
        complaints += [
            f"the model card's key '{key}' is needed for a network with hints"
            for key, value in needed.items()
            if not value
        ]
        if self.multiple_of is not None:
            complaints.append("the model card's key 'multiple_of': a network with hints has a fixed size")
        return complaints

    def _complaints_of_levels(self) -> list[str]:
        key = "the model card's key 'hint_layout' is 'levels'"
        complaints = []
        if set(self.hints) != {"ground", "points"}:
            complaints.append(f"{key}: it needs the hints 'ground' and 'points', not {list(self.hints)}")
        try:
            hint_shapes(self.input_width, self.input_height)
        except HintError as error:
            complaints.append(f"{key}: {error}")
        return complaints

    @property
    def _given(self) -> set[str]:
        return self.model_fields_set

    def input_size(self, camera: CameraModel) -> tuple[int, int]:
        """Width and height in pixels that a camera's picture is resized to for the network.

        With a fixed size it is that. With `multiple_of` it is the whole multiples nearest to the camera's
        aspect ratio at about `input_width * input_height` pixels.
        """
        if self.multiple_of is None:
            return self.input_width, self.input_height
        shrink = (self.input_width * self.input_height / (camera.width * camera.height)) ** 0.5
        width, height = (
            max(1, round(side * shrink / self.multiple_of)) * self.multiple_of
            for side in (camera.width, camera.height)
        )
        return width, height

    @classmethod
    def from_json(cls, text: str | bytes, source: str) -> ModelCard:
        """Card from its JSON text.

        Args:
            text: the JSON.
            source: the file it came from, for error texts.

        Raises:
            ModelCardError: not JSON, or a key that is missing, unknown, holds an impossible value or
                contradicts another; the text names the key.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            complaints = _complaints(error)
            raise ModelCardError(f"{source}: {'; '.join(complaints)}", complaints) from error

    @classmethod
    def from_toml(cls, data: bytes, source: str) -> ModelCard:
        """Card from a TOML file, whose keys are the card's, as `from_json`.

        Raises:
            ModelCardError: as for `from_json`; for a text that is not TOML with its line.
        """
        try:
            values: dict[str, Any] = tomllib.loads(data.decode("utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ModelCardError(f"{source}: the model card cannot be read: {error}") from error
        # TOML has dates of its own, and arrays where strict pydantic wants tuples: JSON has neither.
        return cls.from_json(json.dumps(values, default=str), source)

    def to_json(self) -> str:
        """The card as JSON text, to be stored under `CARD_METADATA_KEY`; in version 1 without newer keys."""
        left_out = set(_SECOND_VERSION_KEYS) if self.card_version == 1 else set()
        return self.model_dump_json(indent=2, exclude=left_out, exclude_none=True)


def _complaints(error: ValidationError) -> list[str]:
    """Every complaint about a card, each by the key it is about."""
    texts = []
    for item in error.errors(include_url=False):
        key = ".".join(str(part) for part in item["loc"])
        if item["type"] == "missing":
            texts.append(f"the model card lacks the key '{key}'")
        elif item["type"] == "extra_forbidden":
            texts.append(f"the model card has the unknown key '{key}'")
        elif item["type"] == "keys":
            texts += item["msg"].splitlines()
        elif not key:
            texts.append(f"the model card cannot be read: {item['msg']}")
        else:
            texts.append(f"the model card's key '{key}' is {item['input']!r}: {item['msg']}")
    return texts
