"""What one frame costs, step by step, in processor time of one core."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from service.benchmark.pictures import CAMERA, FPS, HEIGHT_M, LEVEL, MOUNT, SPEED_MPS
from service.frame import Frame
from service.network import answers_in_metres, network_kind
from service.pipeline import Perception
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.depth.codec import encode_depth_png
from uavdepth.messages.obstacle_distance import encode_obstacle_distance
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.inference import InferenceSession, open_session
from uavdepth.scale.estimator import METRIC_FACTORS, ScaleEstimator
from uavdepth.scale.ground_scale import GroundScaler
from uavdepth.scan.scanner import ObstacleScanner

_WARM_UP = 3
_NEAR_M, _FAR_M = 0.5, 60.0


@dataclass(frozen=True)
class StageTimes:
    """Medians over the frames, milliseconds of processor time on one core at 640x320.

    Args:
        network: inference alone.
        around_network: resize, normalise, depth of the output, to the camera's pixels.
        ground_scale, scan, message: the other steps of the flight path.
        after_sending: what of a picture only the next ones need; its distances do not wait for it.
        all_but_network: one whole step of the pipeline with the message and what comes after, less inference.
        depth_png: the ground station's depth picture; made by the publisher, not on the flight path.
    """

    network: float
    around_network: float
    ground_scale: float
    scan: float
    message: float
    after_sending: float
    all_but_network: float
    depth_png: float


class _Stopwatch:
    """A session that notes the processor time of its last run."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.get_inputs = session.get_inputs
        self.last_ms = 0.0

    def run(self, *arguments: Any) -> Any:
        begun_ns = time.thread_time_ns()
        outputs = self._session.run(*arguments)
        self.last_ms = (time.thread_time_ns() - begun_ns) / 1e6
        return outputs


def measure_stages(model_name: str, pictures: list[NDArray[np.uint8]]) -> StageTimes:
    """Measure every step on rendered pictures.

    Args:
        model_name: a network file, or the name of one that ships.
        pictures: (320, 640, 3) uint8 BGR each.
    """
    cv2.setNumThreads(1)
    loaded = DepthModel.load(model_name, "cpu", 1, precision="float")
    session = open_session(Path(loaded.source), "cpu", 1, "float")
    watch = _Stopwatch(session.session)
    model = DepthModel(InferenceSession(watch, session.provider), loaded.card, loaded.source)
    factors = METRIC_FACTORS if loaded.card.metric else None
    scaler, scanner = GroundScaler(CAMERA, MOUNT, factors), ObstacleScanner(CAMERA, MOUNT)
    settings = Settings.model_validate(
        {
            "camera": {"source": "sim:city", "width": CAMERA.width, "height": CAMERA.height},
            "mount": {"pitch_deg": MOUNT.pitch_deg},
        }
    )
    max_depth_m = float("inf") if loaded.card.max_depth_m is None else loaded.card.max_depth_m
    estimator = (
        None if answers_in_metres(loaded.card) else ScaleEstimator(CAMERA, MOUNT, network_kind(loaded.card))
    )
    perception = Perception(settings, model, estimator, scanner, max_depth_m, loaded.card.hints)
    rows = []
    for number, picture in enumerate(pictures):
        captured_ns = round(number / FPS * 1e9)
        frame = Frame(picture, captured_ns, number)
        place = (SPEED_MPS * number / FPS, 0.0, -HEIGHT_M)
        telemetry = Telemetry(captured_ns, LEVEL, HEIGHT_M, place, (SPEED_MPS, 0.0, 0.0))
        depth, infer_ms = _timed(partial(model.infer, picture, CAMERA))
        network_ms = watch.last_ms
        depth_m = depth.depth_m
        _, scale_ms = _timed(partial(scaler.estimate, depth_m, LEVEL, HEIGHT_M))
        scan, scan_ms = _timed(partial(scanner.scan, depth_m, LEVEL, HEIGHT_M))
        _, message_ms = _timed(partial(encode_obstacle_distance, scan))
        _, step_ms = _timed(partial(perception.step, frame, telemetry))
        _, png_ms = _timed(partial(encode_depth_png, depth_m, _NEAR_M, _FAR_M))
        step_network_ms = watch.last_ms
        _, after_ms = _timed(perception.look_ahead)
        around_ms, rest_ms = infer_ms - network_ms, step_ms - step_network_ms + message_ms + after_ms
        rows.append((network_ms, around_ms, scale_ms, scan_ms, message_ms, after_ms, rest_ms, png_ms))
    return StageTimes(*(round(float(value), 2) for value in np.median(rows[_WARM_UP:], axis=0)))


def _timed(step: Callable[[], Any]) -> tuple[Any, float]:
    begun_ns = time.thread_time_ns()
    result = step()
    return result, (time.thread_time_ns() - begun_ns) / 1e6
