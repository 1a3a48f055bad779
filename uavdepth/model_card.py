"""The model card: what an ONNX file says about itself, and the contract between training and flight."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError, field_validator

from uavdepth.errors import ModelCardError

CARD_METADATA_KEY = "uavdepth.card"
"""Key of the ONNX metadata_props entry that holds the card as JSON."""

CARD_FILE_SUFFIX = ".card.json"
"""A foreign network's card lies beside it: `FILE.onnx.card.json`."""

OutputKind = Literal["log_inverse_depth", "inverse_depth", "depth"]
"""What the depth output holds, before the focal length is applied."""

PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]


class ModelCard(BaseModel):
    """What a depth network needs and gives.

    The network's input is one float32 picture (1, 3, input_height, input_width), RGB, as
    `(pixel / 255 - mean) / std`; `DepthModel` does that arithmetic, so a graph that normalises by
    itself has mean 0 and std 1. The picture is the camera's, stretched to the input size.

    The output (1, 1, input_height, input_width) is normalised by focal length: with `f` the camera's
    focal length in pixels of the network's width, z-depth in metres is

        log_inverse_depth:  (f / focal_px) * exp(-output)
        inverse_depth:      (f / focal_px) / output
        depth:              (f / focal_px) * output

    The second output, where `uncertainty` is true, is (1, 1, H, W): log of sigma / depth.
    """

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")

    card_version: Literal[1] = Field(description="Version of this format.")
    name: Text = Field(description="Name of the network, for status and records.")
    input_width: int = Field(ge=16, le=4096, description="Width of the network's input, pixels.")
    input_height: int = Field(ge=16, le=4096, description="Height of the network's input, pixels.")
    mean: tuple[FiniteFloat, FiniteFloat, FiniteFloat] = Field(description="Subtracted from RGB in 0..1.")
    std: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(description="Divides RGB after the mean.")
    output: OutputKind = Field(description="What the depth output holds.")
    metric: bool = Field(description="Depth is in metres; false: up to one unknown factor a picture.")
    uncertainty: bool = Field(description="There is a second output, log of relative sigma.")
    focal_px: PositiveFloat = Field(description="Focal length that the output is normalised to, pixels.")
    max_depth_m: PositiveFloat = Field(description="Depth beyond which the network was not trained.")
    training_data: Text = Field(description="What it was trained on.")
    licence: Text = Field(description="Licence of the weights.")
    measured: dict[str, JsonValue] = Field(description="Errors measured on data it was not trained on.")
    created: Text = Field(description="When it was exported, ISO 8601.")
    input_name: Text = Field(default="image", description="Name of the network's input.")
    output_name: Text = Field(default="log_inverse_depth", description="Name of the depth output.")
    uncertainty_name: Text = Field(default="log_sigma", description="Name of the uncertainty output.")

    @field_validator("measured")
    @classmethod
    def _measured_is_not_huge(cls, value: dict[str, JsonValue]) -> dict[str, JsonValue]:
        if len(value) > 200:
            raise ValueError(f"{len(value)} entries: at most 200 are read")
        return value

    @classmethod
    def from_json(cls, text: str | bytes, source: str) -> ModelCard:
        """Card from its JSON text.

        Args:
            text: the JSON.
            source: the file it came from, for error texts.

        Raises:
            ModelCardError: not JSON, or a key that is missing, unknown or holds an impossible value;
                the text names the key.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            raise ModelCardError(f"{source}: {_explain(error)}") from error

    def to_json(self) -> str:
        """The card as JSON text, to be stored under `CARD_METADATA_KEY`."""
        return self.model_dump_json(indent=2)


def _explain(error: ValidationError) -> str:
    """Every complaint in one line, each by the key it is about."""
    texts = []
    for item in error.errors(include_url=False):
        key = ".".join(str(part) for part in item["loc"])
        if item["type"] == "missing":
            texts.append(f"the model card lacks the key '{key}'")
        elif item["type"] == "extra_forbidden":
            texts.append(f"the model card has the unknown key '{key}'")
        elif not key:
            texts.append(f"the model card cannot be read: {item['msg']}")
        else:
            texts.append(f"the model card's key '{key}' is {item['input']!r}: {item['msg']}")
    return "; ".join(texts)
