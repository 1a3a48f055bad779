"""Checkpoints of a self-supervised run."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from training.errors import CheckpointError
from training.selfsupervised.settings import SelfSupervisedSettings, parse_settings

FORMAT = "uavdepth self-supervised 1"

_LOAD_ERRORS = (KeyError, TypeError, AttributeError, RuntimeError, EOFError, OSError, ValueError)


@dataclass(frozen=True)
class RunState:
    """Everything that a run needs to go on as if it had never stopped.

    Batches are functions of their number and the learning rate one of the pictures shown; what else is
    random (weights at the start) lies behind it. PyTorch's random state is kept all the same, for networks
    that draw numbers while they learn.

    Args:
        settings: of the run.
        step, images: how far it is.
        trained_s: seconds of training so far.
        networks, optimizer: their state dictionaries.
        random: PyTorch's random state.
    """

    settings: SelfSupervisedSettings
    step: int
    images: int
    trained_s: float
    networks: dict[str, Tensor]
    optimizer: dict[str, Any]
    random: Tensor

    def save(self, path: Path) -> None:
        """Write to `path`; a crash or a full disk leaves the old file whole.

        Raises:
            CheckpointError: it cannot be written; names the reason.
        """
        partial = path.with_name(path.name + ".part")
        content = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "settings"}
        content |= {"format": FORMAT, "settings": self.settings.model_dump(mode="json")}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            torch.save(content, partial)
            partial.replace(path)
        except (OSError, RuntimeError) as error:
            partial.unlink(missing_ok=True)
            # PyTorch's writer tells a full disk as RuntimeError.
            raise CheckpointError(f"cannot write the checkpoint {path}: {error}") from error

    @classmethod
    def load(cls, path: Path) -> RunState:
        """Read a checkpoint without executing code from it.

        Raises:
            CheckpointError: it is missing, broken or of another kind of run.
        """
        if not path.is_file():
            raise CheckpointError(f"no checkpoint at {path}")
        try:
            content: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
            if content.pop("format", None) != FORMAT:
                raise CheckpointError(f"{path} is not a checkpoint of self-supervised training ({FORMAT})")
            settings = parse_settings(content.pop("settings"), str(path))
            return cls(settings=settings, **content)
        except CheckpointError:
            raise
        except pickle.UnpicklingError as error:
            # PyTorch's own text advises to load the file without its protection.
            raise CheckpointError(f"{path} is not a checkpoint of this program") from error
        except _LOAD_ERRORS as error:
            raise CheckpointError(f"{path} is not a checkpoint of this program: {error}") from error
