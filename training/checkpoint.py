"""Checkpoints: everything that a run needs to go on as if it had never stopped."""

from __future__ import annotations

import io
import os
import pickle
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from training.data.hint_sampling import HintShares
from training.data.surface_patterns import AppearanceShares
from training.errors import CheckpointError
from training.losses import LossWeights
from training.networks.depth_network import DepthNetwork, NetworkShape
from training.settings import LargePictures, SizePhase, TrainingSettings

FORMAT = 2
"""2: the network takes hints."""

ARCHITECTURE = "lite0-fan-eca-hints"
"""Name of `DepthNetwork`, written into every checkpoint so that another one's is told by name."""

_READ_ERRORS = (RuntimeError, EOFError, OSError, ValueError, KeyError, AttributeError, TypeError)
"""Whatever PyTorch raises for a file that is something else."""

_CONTENT_ERRORS = (KeyError, TypeError, ValueError)
"""What a content that lacks an entry, or holds one of another kind, leads to."""


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
        """Write to `path`; whatever goes wrong leaves the old file whole.

        Raises:
            CheckpointError: it cannot be written, because the disk is full, for example.
        """
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "settings"}
        content = {
            "format": FORMAT,
            "architecture": ARCHITECTURE,
            "settings": asdict(self.settings),
            **fields,
        }
        # PyTorch's own writer hides why writing failed; the operating system says it.
        buffer = io.BytesIO()
        torch.save(content, buffer)
        partial = path.with_name(path.name + ".part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with partial.open("wb") as file:
                file.write(buffer.getbuffer())
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            kept = "the one before it is whole" if path.exists() else "there is none before it"
            raise CheckpointError(f"{path} cannot be written: {error.strerror}; {kept}") from error

    @classmethod
    def load(cls, path: Path) -> Checkpoint:
        """Read a checkpoint. Raises CheckpointError if it is missing, broken or of another format."""
        content = _read(path)
        try:
            found = content.pop("format")
            if found != FORMAT:
                raise CheckpointError(
                    f"{path} is a checkpoint of format {found}, {FORMAT} is needed: a new run can start from "
                    "its weights with --init"
                )
            architecture = content.pop("architecture")
            if architecture != ARCHITECTURE:
                raise CheckpointError(
                    f"{path} is a checkpoint of the network '{architecture}', '{ARCHITECTURE}' is needed"
                )
            return cls(settings=_settings(content.pop("settings")), **content)
        except _CONTENT_ERRORS as error:
            raise CheckpointError(f"{path} is not a checkpoint of this program: {error!r}") from error

    def restore(self, network: DepthNetwork) -> None:
        """Load the weights as they were trained last. Raises CheckpointError if they do not fit."""
        _load_state(network, self.network)

    def averaged_network(self) -> DepthNetwork:
        """The network with its averaged weights, ready to infer. Raises CheckpointError."""
        network = DepthNetwork(self.settings.shape)
        _load_state(network, self.average)
        return network.eval()


def is_checkpoint_of(path: Path, format: str) -> bool:
    """Whether a checkpoint is of another kind of run, by its format. Raises CheckpointError: it is none."""
    return bool(_read(path).get("format") == format)


def read_weights(path: Path) -> dict[str, Tensor]:
    """Averaged weights of a checkpoint of any format. Raises CheckpointError."""
    average = _read(path).get("average")
    if not isinstance(average, dict):
        raise CheckpointError(f"{path} is not a checkpoint of this program: it has no averaged weights")
    return {name: value for name, value in average.items() if isinstance(value, Tensor)}


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise CheckpointError(f"no checkpoint at {path}")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        # PyTorch's own text advises to load the file without its protection.
        raise CheckpointError(f"{path} is not a checkpoint of this program") from error
    except _READ_ERRORS as error:
        raise CheckpointError(f"{path} is not a checkpoint of this program: {error}") from error
    if not isinstance(content, dict):
        raise CheckpointError(
            f"{path} is not a checkpoint of this program: it holds a {type(content).__name__}"
        )
    return content


def _load_state(network: DepthNetwork, state: dict[str, Tensor]) -> None:
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        raise CheckpointError(f"the checkpoint's weights do not fit its network: {error}") from error


def _settings(fields: dict[str, Any]) -> TrainingSettings:
    fields["phases"] = tuple(SizePhase(**phase) for phase in fields["phases"])
    # Runs begun before thin things counted more go on as they were.
    fields["loss"] = LossWeights(**{"thin": 1.0, **fields["loss"]})
    fields["shape"] = NetworkShape(**fields["shape"])
    fields["hints"] = HintShares(**fields["hints"])
    # Runs begun before surfaces were changed go on without.
    fields["appearance"] = AppearanceShares(
        **fields.get("appearance", {"patterns": 0.0, "filters": 0.0, "photos": 0.0})
    )
    fields["large"] = None if fields["large"] is None else LargePictures(**fields["large"])
    return TrainingSettings(**fields)
