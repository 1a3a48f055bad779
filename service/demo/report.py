"""What the demo says at the end."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Latency:
    """Latency from exposure to the last byte handed to the socket, milliseconds."""

    p50: float | None
    p95: float | None


@dataclass(frozen=True)
class DemoReport:
    """One flight of the demo.

    Args:
        scene: the rendered world flown in, NAME:SEED.
        flavor: which autopilot was played.
        blind: flown without the service.
        frames: frames that the service turned into depth.
        fps: frames per second of the service, from its own status.
        obstacle_messages: OBSTACLE_DISTANCE messages that reached the autopilot.
        obstacle_rate_hz: their rate while the vehicle flew forward.
        latency_ms: capture to wire, from the service's own status.
        flew: the vehicle reached half its speed towards the obstacle.
        stopped: it then came to rest in front of it, without touching.
        collided: it touched something.
        stop_distance_m: nearest obstacle ahead in the last scan, or None.
        true_distance_m: nearest surface ahead within the same bearings and height band, from the
            scene's geometry, or None.
        zenoh_samples: scans and pictures received over Zenoh.
        flown_s: seconds from take-off command to the end.
        reason: why the flight ended.
    """

    scene: str
    flavor: str
    blind: bool
    frames: int
    fps: float | None
    obstacle_messages: int
    obstacle_rate_hz: float
    latency_ms: Latency
    flew: bool
    stopped: bool
    collided: bool
    stop_distance_m: float | None
    true_distance_m: float | None
    zenoh_samples: int
    flown_s: float
    reason: str

    @property
    def passed(self) -> bool:
        """True only if the vehicle flew, stopped and touched nothing."""
        return self.flew and self.stopped and not self.collided
