"""How many pictures a second the networks take, on every provider that runs them, measured in turns."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from service.benchmark.pictures import CAMERA, HEIGHT_M, LEVEL, MOUNT
from service.benchmark.reference import BASELINE, PAPER_NETWORK, ReferenceUnavailableError, write_reference
from uavdepth.errors import ModelFileError
from uavdepth.model.card import ModelCard
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.model.inference import InferenceSession, open_session
from uavdepth.model.int8_file import int8_beside
from uavdepth.model.network_file import WEIGHTS_FOLDER, shipped_networks
from uavdepth.model.providers import PROVIDERS

SIZES = ((384, 192), (640, 320))
_WARM_UP = 3
_POINTS = 100


@dataclass(frozen=True)
class NetworkSpeed:
    """A network's speed on one provider: medians of wall time, all cores, a camera of 640x320.

    Args:
        name: of the network.
        width, height: of its input.
        provider, precision: what computed it, and in which number format.
        fps_median: 1 over the median time of the network alone.
        preprocess_ms: picture and hints, a hundred points among them, to the network's input.
        postprocess_ms: its output to metres at the camera's pixels.
    """

    name: str
    width: int
    height: int
    provider: str
    precision: str
    fps_median: float
    preprocess_ms: float
    postprocess_ms: float


@dataclass(frozen=True)
class NetworkSpeeds:
    """What `measure_networks` found.

    Args:
        models: the shipped networks and the paper's, on each provider that loads.
        baseline: Monodepth2 in float32 on the CPU provider, for each size; None where it cannot be made.
        baseline_reason: why it cannot.
        ratio_to_baseline: frames/s of the fastest shipped network over the baseline's, by "WIDTHxHEIGHT".
    """

    models: tuple[NetworkSpeed, ...]
    baseline: tuple[NetworkSpeed, ...] | None
    baseline_reason: str | None
    ratio_to_baseline: dict[str, float] | None

    def as_json(self) -> dict[str, Any]:
        """The same as JSON values."""
        return asdict(self)


def _hints() -> Hints:
    """What a vehicle knows in flight: the ground, and points all over the picture."""
    rng = np.random.default_rng(0)
    pixels = rng.random((_POINTS, 2), np.float32) * (CAMERA.width - 1, CAMERA.height - 1)
    depth_m = rng.uniform(3.0, 40.0, _POINTS).astype(np.float32)
    points = PointHints(pixels.astype(np.float32), depth_m, np.full(_POINTS, 0.1, np.float32))
    return Hints(GroundHint(MOUNT, LEVEL, HEIGHT_M), points)


class _Stopwatch:
    """A session that notes when its last run began and ended."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.get_inputs = session.get_inputs
        self.begun_ns = self.ended_ns = 0

    def run(self, *arguments: Any) -> Any:
        self.begun_ns = time.perf_counter_ns()
        outputs = self._session.run(*arguments)
        self.ended_ns = time.perf_counter_ns()
        return outputs


class _Runner:
    """One network on one provider, with the times of its runs."""

    def __init__(self, name: str, inference: InferenceSession, card: ModelCard) -> None:
        self.name, self.card, self.inference = name, card, inference
        self._watch = _Stopwatch(inference.session)
        session = InferenceSession(self._watch, inference.provider, inference.precision)
        self._model = DepthModel(session, card, name)
        self._hints = _hints()
        self._times_ns: list[tuple[int, int, int]] = []

    def run(self, picture: NDArray[np.uint8]) -> None:
        begun_ns = time.perf_counter_ns()
        self._model.infer(picture, CAMERA, self._hints)
        ended_ns, watch = time.perf_counter_ns(), self._watch
        self._times_ns.append(
            (watch.begun_ns - begun_ns, watch.ended_ns - watch.begun_ns, ended_ns - watch.ended_ns)
        )

    def speed(self) -> NetworkSpeed:
        before_ns, network_ns, after_ns = np.median(self._times_ns[_WARM_UP:], axis=0)
        return NetworkSpeed(
            self.name,
            self.card.input_width,
            self.card.input_height,
            self.inference.provider,
            self.inference.precision,
            round(1e9 / float(network_ns), 2),
            round(float(before_ns) / 1e6, 2),
            round(float(after_ns) / 1e6, 2),
        )


def measure_networks(
    pictures: Sequence[NDArray[np.uint8]],
    rounds: int,
    *,
    names: Sequence[str] | None = None,
    sizes: Sequence[tuple[int, int]] = SIZES,
    reference: Callable[[str, int, int, Path], tuple[Path, ModelCard]] = write_reference,
    note: Callable[[str], None] = lambda _text: None,
) -> NetworkSpeeds:
    """Measure shipped networks, the paper's network and Monodepth2.

    Every round runs each of them once, so that what else the machine does meets all of them alike.

    Args:
        pictures: (320, 640, 3) uint8 BGR each.
        rounds: runs of each network, besides the warm-up.
        names: networks that ship, by name, or files; None for all that ship.
        sizes: input sizes of the reference networks.
        reference: makes them; raises `ReferenceUnavailableError` where it cannot.
        note: is told what is going on.

    Raises:
        ModelFileError: a network that is no network.
        ModelCardError: one without a card.
    """
    # As in flight, where OpenCV's own threads would take the cores from inference.
    cv2.setNumThreads(1)
    runners: list[_Runner] = []
    for name in shipped_networks() if names is None else names:
        model = DepthModel.load(name, "cpu", precision="float")
        path = Path(model.source)
        shown = path.stem if path.parent == WEIGHTS_FOLDER else str(path)
        runners += _on_every_provider(shown, path, model.card, note)
    shipped = len(runners)
    baselines: list[_Runner] = []
    reason = None
    with tempfile.TemporaryDirectory(prefix="uavdepth-benchmark-") as folder:
        try:
            for width, height in sizes:
                note(f"writing {PAPER_NETWORK} and {BASELINE} {width}x{height}")
                path, card = reference(PAPER_NETWORK, width, height, Path(folder))
                runners += _on_every_provider(PAPER_NETWORK, path, card, note)
                path, card = reference(BASELINE, width, height, Path(folder))
                baselines.append(_Runner(BASELINE, open_session(path, "cpu", None, "float"), card))
        except ReferenceUnavailableError as error:
            reason = str(error)
    for number in range(rounds + _WARM_UP):
        note(f"round {number + 1} of {rounds + _WARM_UP}")
        for runner in (*runners, *baselines):
            runner.run(pictures[number % len(pictures)])
    speeds = [runner.speed() for runner in runners]
    baseline = None if reason is not None else tuple(runner.speed() for runner in baselines)
    return NetworkSpeeds(tuple(speeds), baseline, reason, _ratios(speeds[:shipped], baseline))


def _on_every_provider(name: str, path: Path, card: ModelCard, note: Callable[[str], None]) -> list[_Runner]:
    """The network on each provider that is installed and takes it, in 8 bits too where that is what flies."""
    runners = []
    for provider, candidate in PROVIDERS.items():
        if not candidate.is_installed():
            continue
        has_int8 = candidate.prefers_int8() and int8_beside(path).is_file()
        for precision in ("float", "int8") if has_int8 else ("float",):
            try:
                runners.append(_Runner(name, open_session(path, provider, None, precision), card))
            except ModelFileError as error:
                note(str(error))
    return runners


def _ratios(
    shipped: Sequence[NetworkSpeed], baseline: Sequence[NetworkSpeed] | None
) -> dict[str, float] | None:
    if baseline is None:
        return None
    ratios = {}
    for slow in baseline:
        same_size = [
            one.fps_median for one in shipped if (one.width, one.height) == (slow.width, slow.height)
        ]
        if same_size:
            ratios[f"{slow.width}x{slow.height}"] = round(max(same_size) / slow.fps_median, 2)
    return ratios
