"""A calibration as the `[camera]` section of the configuration, as words and as JSON."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from typing import Any

from service.errors import ConfigError
from service.settings import Settings
from service.settings.camera import CameraSettings
from uavdepth.calibration.advice import Advice, horizontal_fov_deg
from uavdepth.calibration.board import Board
from uavdepth.calibration.coverage import Coverage
from uavdepth.calibration.detection import Refusal
from uavdepth.calibration.solve import Calibration

_NAMES_SHOWN = 12
_REASONS_SHOWN = 20
_FOCAL_KEYS = ("fx", "fy", "cx", "cy")
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def camera_section(calibration: Calibration, source: str | None, board: Board) -> str:
    """TOML text of a `[camera]` section that the settings accept.

    Args:
        calibration: what was solved.
        source: the live camera that was calibrated, or None if it was a folder or a video.
        board: for the comment.

    Raises:
        ConfigError: the settings would refuse it.
    """
    camera = calibration.camera
    comment = "" if source is not None else "  # the camera that took the pictures"
    lens = ", ".join(f"{value:.8g}" for value in camera.distortion)
    lines = [
        f"# Calibrated from {len(calibration.views)} pictures of a {board.name}.",
        f"# Re-projection error {calibration.rms_px:.3f} pixels.",
        f"# Standard deviations in pixels: {_sigma_words(calibration)}.",
        "[camera]",
        f"source = {json.dumps(source if source is not None else '0')}{comment}",
        f"width = {camera.width}",
        f"height = {camera.height}",
        *(f"{key} = {float(round(getattr(camera, key), 4))!r}" for key in _FOCAL_KEYS),
        f"distortion = [{lens}]",
    ]
    text = "\n".join(lines) + "\n"
    loaded = _load(text)
    if loaded.model.width != camera.width or abs(loaded.model.fx - camera.fx) > 1e-3:
        raise ConfigError("the written [camera] section does not read back as the calibrated camera")
    return text


def _load(text: str) -> CameraSettings:
    try:
        return Settings.model_validate(tomllib.loads(text)).camera
    except ValueError as error:  # pydantic's ValidationError and tomllib's TOMLDecodeError are both
        raise ConfigError(f"the calibrated camera does not fit [camera]: {error}") from error


def words(
    calibration: Calibration,
    coverage: Coverage,
    refused: Sequence[Refusal],
    unused: int,
    advice: Sequence[Advice],
) -> list[str]:
    """The result in lines for a terminal.

    Args:
        unused: pictures with a board that were not needed.
    """
    camera = calibration.camera
    worst = sorted(calibration.views, key=lambda solved: solved.rms_px, reverse=True)[:3]
    lines = [
        f"pictures       {len(calibration.views)} used, {unused} more not needed, {len(refused)} refused",
        f"error          {calibration.rms_px:.3f} px; largest "
        + ", ".join(f"{solved.view.name} {solved.rms_px:.3f}" for solved in worst),
        f"focal length   fx {camera.fx:.2f} +- {calibration.sigma[0]:.2f}, "
        f"fy {camera.fy:.2f} +- {calibration.sigma[1]:.2f} px",
        f"middle         cx {camera.cx:.2f} +- {calibration.sigma[2]:.2f}, "
        f"cy {camera.cy:.2f} +- {calibration.sigma[3]:.2f} px",
        f"field of view  {horizontal_fov_deg(camera):.1f} degrees across, lens distortion aside",
        f"coverage       corners in {coverage.share:.0%} of the picture",
    ]
    lines += [f"refused        {line}" for line in reasons(refused)]
    lines += [f"left out       {line}" for line in reasons(calibration.left_out)]
    lines += [f"{'SERIOUS' if remark.serious else 'ADVICE':<15}{remark.text}" for remark in advice]
    return lines


def reasons(refused: Sequence[Refusal]) -> list[str]:
    """Pictures by the reason for which they were not used; of many, some."""
    names: dict[str, list[str]] = {}
    for refusal in refused:
        names.setdefault(refusal.reason, []).append(refusal.name)
    lines = []
    for reason, those in names.items():
        more = f" and {len(those) - _NAMES_SHOWN} more" if len(those) > _NAMES_SHOWN else ""
        lines.append(f"{', '.join(those[:_NAMES_SHOWN])}{more}: {reason}")
    if len(lines) > _REASONS_SHOWN:
        lines = [*lines[:_REASONS_SHOWN], f"and {len(lines) - _REASONS_SHOWN} more reasons; --json has all"]
    return lines


def as_json(
    calibration: Calibration,
    coverage: Coverage,
    refused: Sequence[Refusal],
    unused: int,
    advice: Sequence[Advice],
) -> str:
    """The same for programs."""
    camera = calibration.camera
    answer: dict[str, Any] = {
        "camera": {
            "width": camera.width,
            "height": camera.height,
            **{key: getattr(camera, key) for key in _FOCAL_KEYS},
            "distortion": list(camera.distortion),
        },
        "distortion_model": calibration.distortion.value,
        "sigma": dict(zip((*_FOCAL_KEYS, *_COEFFICIENTS), calibration.sigma, strict=False)),
        "error_px": calibration.rms_px,
        "horizontal_fov_deg": horizontal_fov_deg(camera),
        "pictures": [
            {
                "name": solved.view.name,
                "error_px": solved.rms_px,
                "corners": len(solved.view.ids),
                "tilt_deg": solved.tilt_deg,
                "edge_width_px": solved.view.edge_width_px,
            }
            for solved in calibration.views
        ],
        "left_out": [{"name": each.name, "reason": each.reason} for each in calibration.left_out],
        "refused": [{"name": each.name, "reason": each.reason} for each in refused],
        "not_needed": unused,
        "coverage": {
            "share": coverage.share,
            "counts": coverage.counts.tolist(),
            "empty_corners": list(coverage.empty_corners),
        },
        "advice": [{"text": remark.text, "serious": remark.serious} for remark in advice],
    }
    return json.dumps(answer, indent=2)


def _sigma_words(calibration: Calibration) -> str:
    pairs = zip(_FOCAL_KEYS, calibration.sigma, strict=False)
    return ", ".join(f"{key} {sigma:.2f}" for key, sigma in pairs)
