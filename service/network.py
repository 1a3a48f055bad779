"""The configured depth network."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import structlog

from service.errors import ConfigError
from service.settings import Settings
from uavdepth.errors import ModelCardError, ModelFileError, ProviderFallbackWarning

if TYPE_CHECKING:
    from uavdepth.model.card import ModelCard
    from uavdepth.model.depth_model import DepthModel
    from uavdepth.scale.estimator import NetworkKind

log = structlog.get_logger()


def load_network(settings: Settings) -> DepthModel:
    """Load the network that the configuration names, and say what runs it.

    Raises:
        ConfigError: a network that is missing, has no card, or cannot be run.
    """
    from uavdepth.model.depth_model import DepthModel

    wanted = settings.model
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ProviderFallbackWarning)
            model = DepthModel.load(
                wanted.path, wanted.provider, wanted.threads, wanted.card, wanted.precision
            )
    except (ModelFileError, ModelCardError) as error:
        raise ConfigError(f"[model] path: {error}") from error
    log.info("network", name=model.card.name, provider=model.provider, precision=model.precision)
    if model.fallback_reason is not None:
        log.warning(
            "network runs slower than it could",
            provider=model.provider,
            precision=model.precision,
            why=model.fallback_reason,
        )
    return model


def answers_in_metres(card: ModelCard) -> bool:
    """Whether a network answers in metres that it took from what it was told."""
    return card.metric and bool(card.hints)


def network_kind(card: ModelCard) -> NetworkKind:
    """What has to be found for metres of a network's answer."""
    if card.output == "affine_inverse_depth":
        return "affine"
    return "metric" if card.metric else "relative"
