"""Checkpoints: everything that a run needs to go on as if it had never stopped."""

from __future__ import annotations

import pickle
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from training.errors import CheckpointError
from training.losses import LossWeights
from training.networks.depth_network import DepthNetwork, NetworkShape
from training.settings import SizePhase, TrainingSettings

FORMAT = 1

_LOAD_ERRORS = (
    KeyError,
    TypeError,
    AttributeError,
    RuntimeError,
    EOFError,
    OSError,
    ValueError,
)
"""Whatever PyTorch and the settings raise for a file that is something else."""


@dataclass
class Checkpoint:
    """State of a run. Batches are functions of their number, so no random state is needed.

    Args:
        settings: of the run.
        step, images, trained_s: how far it is.
        network, average, optimizer: their state dictionaries.
        frames, worlds: size of the training set at that moment.
    """

    settings: TrainingSettings
    step: int
    images: int
    trained_s: float
    network: dict[str, Tensor]
    average: dict[str, Tensor]
    optimizer: dict[str, Any]
    frames: int
    worlds: int

    def save(self, path: Path) -> None:
        """Write to `path`; a crash leaves the old file whole."""
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".part")
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "settings"}
        torch.save({"format": FORMAT, "settings": asdict(self.settings), **fields}, partial)
        partial.replace(path)

    @classmethod
    def load(cls, path: Path) -> Checkpoint:
        """Read a checkpoint. Raises CheckpointError if it is missing, broken or of another format."""
        if not path.is_file():
            raise CheckpointError(f"no checkpoint at {path}")
        try:
            content: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
            if content.pop("format") != FORMAT:
                raise CheckpointError(f"{path} is not a checkpoint of format {FORMAT}")
            return cls(settings=_settings(content.pop("settings")), **content)
        except CheckpointError:
            raise
        except pickle.UnpicklingError as error:
            # PyTorch's own text advises to load the file without its protection.
            raise CheckpointError(f"{path} is not a checkpoint of this program") from error
        except _LOAD_ERRORS as error:
            raise CheckpointError(f"{path} is not a checkpoint of this program: {error}") from error

    def averaged_network(self) -> DepthNetwork:
        """The network with its averaged weights, ready to infer."""
        network = DepthNetwork(self.settings.shape)
        network.load_state_dict(self.average)
        return network.eval()


def _settings(fields: dict[str, Any]) -> TrainingSettings:
    fields["phases"] = tuple(SizePhase(**phase) for phase in fields["phases"])
    fields["loss"] = LossWeights(**fields["loss"])
    fields["shape"] = NetworkShape(**fields["shape"])
    return TrainingSettings(**fields)
