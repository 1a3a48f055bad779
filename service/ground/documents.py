"""What the page is told, as JSON. Ages hold for the time in the frame's header."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from service.freshness import NO_DATA_NS, STALE_NS
from service.ground.fleet import Fleet, Picture, VehicleView
from service.ground.history import HISTORY_S, STEP_NS, HistoryPoint


@dataclass(frozen=True)
class ZenohView:
    """The station's own Zenoh session.

    Args:
        peers: peers and routers that are connected.
        endpoints: where it listens and connects.
    """

    peers: int
    endpoints: tuple[str, ...]


def fleet_document(fleet: Fleet, zenoh: ZenohView, now_ns: int) -> bytes:
    """All vehicles in short."""
    return _json(
        {
            "vehicles": [_summary(view, now_ns) for view in fleet.views()],
            "zenoh": {"peers": zenoh.peers, "endpoints": zenoh.endpoints},
            "bad_samples": fleet.bad_samples.count,
            "last_bad": fleet.bad_samples.last[:300],
            "stale_ms": STALE_NS / 1e6,
            "no_data_ms": NO_DATA_NS / 1e6,
        }
    )


def detail_document(view: VehicleView, camera: Picture | None, now_ns: int) -> bytes:
    """Everything but the pictures of one vehicle."""
    scan, status = view.scan, view.status
    return _json(
        {
            **_summary(view, now_ns),
            "scan": None
            if scan is None
            else {
                "index": scan.index,
                "trusted": scan.trusted,
                "trouble": scan.trouble,
                "min_m": scan.min_distance_m,
                "max_m": scan.max_distance_m,
                "first_deg": scan.first_bearing_deg,
                "step_deg": scan.step_deg,
                "state": scan.state,
                "cm": scan.distance_cm,
            },
            "status": None if status is None else status.model_dump(mode="json"),
            "status_age_ms": _age_ms(view.status_born_ns, now_ns),
            "bytes_per_s": view.traffic.bytes_per_s,
            "samples_per_s": view.traffic.samples_per_s,
            "camera": None if camera is None else camera.header.camera.model_dump(mode="json"),
        }
    )


def history_document(points: list[HistoryPoint], now_ns: int) -> bytes:
    """The nearest distances of one vehicle: age in ms, verdict, centimetres, oldest first."""
    return _json(
        {
            "span_ms": HISTORY_S * 1000,
            "step_ms": STEP_NS / 1e6,
            "points": [
                (round((now_ns - point.captured_ns) / 1e6), int(point.verdict), point.nearest_cm)
                for point in points
            ],
        }
    )


def _summary(view: VehicleView, now_ns: int) -> dict[str, Any]:
    reading, status = view.reading, view.status
    return {
        "name": view.name,
        "alive": view.alive,
        "twins": view.twins,
        "age_ms": _age_ms(view.scan_born_ns, now_ns),
        "verdict": 0 if reading is None else int(reading.verdict),
        "nearest_cm": -1 if reading is None else reading.nearest_cm,
        "bearing_deg": 0.0 if reading is None else reading.bearing_deg,
        "state": None if status is None else status.state,
        "mode": None if status is None else status.mode,
        "armed": None if status is None else status.armed,
        "recording": None if status is None else status.recording,
        "status_age_ms": _age_ms(view.status_born_ns, now_ns),
    }


def _age_ms(born_ns: int | None, now_ns: int) -> float | None:
    return None if born_ns is None else max(0.0, round((now_ns - born_ns) / 1e6, 1))


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
