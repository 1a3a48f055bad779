"""The service's configuration in the evaluation: the demo's, with the rendered camera of 320 x 160."""

from __future__ import annotations

from service.demo.plan import ABOVE_M, BELOW_M, MARGIN_M, PARAMETERS
from service.fake_autopilot.autopilot import Flavor
from service.flight_evaluation.truth import HeightBand
from service.settings import Settings

WIDTH_PX, HEIGHT_PX = 320, 160
FRAMES_PER_S = 10.0
"""Slower than the service flies with: ten is the least that a vehicle can be trusted with."""
MARGIN = MARGIN_M
_ARMING: dict[Flavor, dict[str, float]] = {
    "ardupilot": {"ARMING_SKIPCHK": -1.0},
    "px4": {},
}
BAND = HeightBand(BELOW_M, ABOVE_M)


def settings_for(model: str, sigma_factor: float | None = None) -> Settings:
    """The configuration that all figures are of, with one network; `sigma_factor` None: the default."""
    caution = {} if sigma_factor is None else {"sigma_factor": sigma_factor}
    return Settings.model_validate(
        {
            "camera": {
                "source": "sim:wall",
                "width": WIDTH_PX,
                "height": HEIGHT_PX,
                "horizontal_fov_deg": 90.0,
                "fps": FRAMES_PER_S,
            },
            "mount": {"pitch_deg": -10.0, "forward_m": 0.1},
            "model": {"path": model, "threads": 1},
            "scan": {"below_m": BELOW_M, "above_m": ABOVE_M, **caution},
        }
    )


def parameters_for(flavor: Flavor) -> dict[str, float]:
    """The demo's autopilot parameters; ArduPilot arms before the service has spoken."""
    return {**PARAMETERS[flavor], **_ARMING[flavor]}
