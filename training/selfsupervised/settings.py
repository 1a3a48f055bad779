"""What a self-supervised run is made of: a TOML file, and the same values in every checkpoint."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from training.errors import TrainingSettingsError

NetworkName = Literal["monodepth2", "hr-depth", "bl", "bl+fan", "bl+fan+se", "bl+fan+eca"]
SourceKind = Literal["airsim", "kitti-raw", "kitti-odometry", "tartanair", "record", "video", "folder"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SourceSettings(_Section):
    """One place that frames come from."""

    kind: SourceKind = Field(description="Layout of the folder or file.")
    path: Path = Field(description="Folder or file.")
    split: Path | None = Field(default=None, description="Split file that lists the frames (KITTI raw).")
    calibration: Path | None = Field(
        default=None, description="Intrinsics of airsim, video or folder that bring none (JSON or TOML)."
    )
    horizontal_fov_deg: float | None = Field(
        default=None, gt=0, lt=180, description="Field of view, where no calibration is known."
    )


class NetworkSettings(_Section):
    """Which network, and what it starts from."""

    name: NetworkName = Field(default="bl+fan+eca", description="The network; the paper's is bl+fan+eca.")
    encoder: Literal["resnet18", "efficientnet-lite0"] = Field(
        default="resnet18", description="Encoder; efficientnet-lite0 for the bl networks only."
    )
    encoder_weights: Path | None = Field(
        default=None, description="ResNet-18 weights in torchvision's format; random ones if not given."
    )


class LossSettings(_Section):
    """Equations 8 to 10; defaults are the paper's."""

    alpha: Share = Field(default=0.85, description="Weight of SSIM against L1 in the re-projection error.")
    smoothness: float = Field(
        default=0.04, ge=0, allow_inf_nan=False, description="Weight lambda of smoothness; Monodepth2: 0.001."
    )
    minimum: bool = Field(default=True, description="Minimum over source frames instead of their mean.")
    auto_mask: bool = Field(default=True, description="Leave out pixels that do not move.")
    min_depth_m: Positive = Field(default=0.1, description="Depth of disparity 1.")
    max_depth_m: Positive = Field(default=100.0, description="Depth of disparity 0.")

    @model_validator(mode="after")
    def _depths_rise(self) -> LossSettings:
        if self.min_depth_m >= self.max_depth_m:
            raise ValueError(f"min_depth_m is {self.min_depth_m:g}: below max_depth_m is needed")
        return self


class SelfSupervisedSettings(_Section):
    """One run. Defaults are the paper's (section 3.2); `image_steps` counts target pictures shown."""

    sources: tuple[SourceSettings, ...] = Field(min_length=1, description="Where frames come from.")
    network: NetworkSettings = NetworkSettings()
    loss: LossSettings = LossSettings()
    width: int = Field(default=384, ge=64, multiple_of=32, description="Width of the network's picture.")
    height: int = Field(default=192, ge=64, multiple_of=32, description="Height of the network's picture.")
    batch: int = Field(default=8, ge=2, description="Pictures a step, over all processes.")
    image_steps: int = Field(ge=1, description="Length of the run in target pictures.")
    learning_rate: Positive = Field(default=1e-4, description="Adam's learning rate at the start.")
    drop_at: Share = Field(default=0.75, description="Share of the run after which the rate drops.")
    drop_to: Share = Field(default=0.1, description="Factor by which it drops.")
    seed: int = Field(default=0, ge=0, description="Of random weights and of the order of pictures.")
    precision: Literal["auto", "fp32", "bf16"] = Field(
        default="auto", description="auto: bf16 where the processor computes it."
    )
    cache: Path = Field(default=Path("cache"), description="Folder for decoded pictures.")

    def rate_at(self, images: int) -> float:
        """Learning rate after so many pictures."""
        dropped = images >= self.drop_at * self.image_steps
        return self.learning_rate * (self.drop_to if dropped else 1.0)

    def difference(self, other: SelfSupervisedSettings) -> str:
        """Keys whose values make another run of this one, in words; empty if none.

        The length, the places of frames, weights and cache, and the precision may change.
        """
        free = {"image_steps", "cache", "precision", "sources"}
        mine, theirs = (item.model_dump(mode="json", exclude=free) for item in (self, other))
        for values in (mine, theirs):
            values["network"].pop("encoder_weights")
        changed = [f"{key} is {mine[key]}, was {theirs[key]}" for key in mine if mine[key] != theirs[key]]
        return "; ".join(changed)


def load_settings(path: Path) -> SelfSupervisedSettings:
    """Read a run's TOML file; relative paths in it are seen from its folder.

    Raises:
        TrainingSettingsError: a file that cannot be read, or a key that is missing, unknown or out of
            bounds; the text names it.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise TrainingSettingsError(f"no configuration of a run at {path}") from error
    except OSError as error:
        raise TrainingSettingsError(f"{path} cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise TrainingSettingsError(f"{path} is not TOML: {error}") from error
    return parse_settings(table, str(path), path.parent)


def parse_settings(
    table: Mapping[str, Any], origin: str, folder: Path | None = None
) -> SelfSupervisedSettings:
    """Settings of plain values.

    Args:
        table: the values.
        origin: where they come from, for error texts.
        folder: that relative paths are seen from; as they are if None.
    """
    try:
        settings = SelfSupervisedSettings.model_validate(table)
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(str(part) for part in item['loc']) or 'the file'}: {item['msg']}"
            for item in error.errors(include_url=False)
        )
        raise TrainingSettingsError(f"{origin}: {problems}") from error
    return settings if folder is None else _seen_from(settings, folder)


def _seen_from(settings: SelfSupervisedSettings, folder: Path) -> SelfSupervisedSettings:
    def seen(path: Path | None) -> Path | None:
        return None if path is None else folder / path

    sources = tuple(
        source.model_copy(
            update={key: seen(getattr(source, key)) for key in ("path", "split", "calibration")}
        )
        for source in settings.sources
    )
    network = settings.network.model_copy(update={"encoder_weights": seen(settings.network.encoder_weights)})
    return settings.model_copy(update={"sources": sources, "network": network, "cache": seen(settings.cache)})
