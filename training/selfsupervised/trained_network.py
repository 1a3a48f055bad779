"""The depth network of a run, taken out of its checkpoint."""

from __future__ import annotations

from training.errors import CheckpointError
from training.networks.catalogue import build_network
from training.networks.disparity import DisparityNetwork
from training.selfsupervised.run_state import RunState

_PREFIX = "depth."


def trained_network(state: RunState) -> DisparityNetwork:
    """The depth network with its learnt weights, ready to infer.

    Raises:
        CheckpointError: weights that are not those of the network that the settings name.
    """
    settings = state.settings.network
    network = build_network(settings.name, settings.encoder, pretrained=False)
    weights = {
        key.removeprefix(_PREFIX): value for key, value in state.networks.items() if key.startswith(_PREFIX)
    }
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise CheckpointError(
            f"the checkpoint's weights are not those of {settings.name} with {settings.encoder}: {error}"
        ) from error
    return network.eval()
