"""What the demo flies, and the configuration of the service that it flies with."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path

from service.fake_autopilot.autopilot import Flavor

VEHICLE = "demo"
_VIEWERS_PORT = 7447
MARGIN_M = 4.0
"""AVOID_MARGIN and CP_DIST of the demo's vehicle, metres."""

BELOW_M = 2.0
ABOVE_M = 1.5
PARAMETERS: dict[Flavor, dict[str, float]] = {
    "ardupilot": {"AVOID_MARGIN": MARGIN_M, "AVOID_BACKUP_SPD": 0.0, "PRX_FILT": 5.0},
    "px4": {"CP_DIST": MARGIN_M},
}
"""What the README asks a builder to set; without backing away, so that the vehicle comes to rest."""

BLIND_PARAMETERS: dict[Flavor, dict[str, float]] = {
    # Without obstacle data ArduPilot does not even arm, and PX4 with Collision Prevention does not move.
    "ardupilot": {"ARMING_SKIPCHK": -1.0},
    "px4": {"CP_DIST": -1.0},
}


@dataclass(frozen=True)
class DemoPlan:
    """One flight.

    Args:
        scene: rendered world, NAME[:SEED].
        flavor: which autopilot is played.
        blind: fly without the service.
        speed_mps: speed towards what stands north of the start.
        height_m: flight height above ground.
        seconds: longest flight, from take-off, after which it ends as "not stopped".
        model: network, a file or the name of one that ships.
    """

    scene: str
    flavor: Flavor
    blind: bool
    speed_mps: float
    height_m: float
    seconds: float
    model: str

    @property
    def parameters(self) -> dict[str, float]:
        """The autopilot's parameters for this flight."""
        return BLIND_PARAMETERS[self.flavor] if self.blind else PARAMETERS[self.flavor]

    def service_toml(self, autopilot_endpoint: str, zenoh_endpoint: str) -> str:
        """The configuration file of `uavdepth run` for this flight."""
        return f"""\
[vehicle]
name = "{VEHICLE}"

[camera]
source = "sim:{self.scene}"
width = 320
height = 200
horizontal_fov_deg = 90.0
fps = 15.0

[mount]
pitch_deg = -10.0
forward_m = 0.1

[model]
path = '{self.model}'

[scan]
below_m = {BELOW_M}
above_m = {ABOVE_M}

[autopilot]
endpoint = "{autopilot_endpoint}"

[zenoh]
listen = ["{zenoh_endpoint}"]
"""


def free_zenoh_endpoint() -> str:
    """A loopback endpoint whose port nobody uses now: where viewers look by default, if that is free."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", _VIEWERS_PORT))
        except OSError:
            probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def write_configuration(folder: Path, plan: DemoPlan, autopilot_endpoint: str, zenoh_endpoint: str) -> Path:
    """Write the service's configuration into `folder` and return its path."""
    path = folder / "uavdepth.toml"
    path.write_text(plan.service_toml(autopilot_endpoint, zenoh_endpoint), encoding="utf-8")
    return path
