"""`[model]`: the depth network and what runs it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.settings.section import Section


class ModelSettings(Section):
    """The depth network and what runs it."""

    path: str = Field(
        default="default",
        min_length=1,
        title="Network",
        description="`default` or another name of weights inside the package, or the path of an ONNX file "
        "with a model card in it or beside it (`FILE.onnx.toml`).",
    )
    card: str | None = Field(
        default=None,
        min_length=1,
        title="Model card",
        description="TOML file with the card of a foreign network, used whatever the network's file says.",
    )
    provider: Literal["auto", "tensorrt", "cuda", "openvino", "cpu"] = Field(
        default="auto",
        title="ONNX Runtime provider",
        description="What computes the network; `auto` takes the first of the others that is installed and "
        "works.",
    )
    precision: Literal["auto", "float", "int8"] = Field(
        default="auto",
        title="Numbers of the network",
        description="`int8` takes the network's 8-bit file, `NAME-int8.onnx` beside `NAME.onnx`; `auto` does "
        "where that is faster, `float` never does.",
    )
    threads: int | None = Field(
        default=None,
        ge=1,
        le=64,
        title="Threads of the network",
        description="Processor threads that inference may use; left out, ONNX Runtime chooses.",
    )
    max_relative_sigma: float = Field(
        default=0.5,
        gt=0.0,
        le=10.0,
        title="Largest uncertainty of a pixel",
        description="Pixels whose standard deviation over depth is larger make no direction clear; near ones "
        "are obstacles still. Only networks with an uncertainty output have it.",
    )
