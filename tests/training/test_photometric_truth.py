"""Rendered frames with exact depth and pose: the truth explains them, and nothing else does as well."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

import torch
from rendered_triplet import RenderedTriplet, rendered_triplet
from torch import Tensor

from training.photometric import PhotometricSettings, photometric_loss, reproject, transform_from_pose
from training.photometric.appearance import over_sources, photometric_error

REBUILT_LIMIT = 0.015
"""Photometric error of a frame rebuilt from the truth: bilinear sampling and the renderer's filter remain."""

DIFFERENCE_LIMIT = 0.006
"""The same as mean absolute difference of colours in 0..1: a level and a half of 255."""

WITHOUT_SMOOTHNESS = PhotometricSettings(smoothness=0.0)


@pytest.fixture(scope="module")
def scene() -> RenderedTriplet:
    return rendered_triplet()


def error(scene: RenderedTriplet, depth_m: Tensor, source_from_target: Tensor, source: int) -> float:
    """Mean photometric error over what both frames show."""
    rebuilt = reproject(scene.sources[source], depth_m, scene.intrinsics, source_from_target)
    return float(photometric_error(rebuilt, scene.target, 0.85)[scene.visible(source)].mean())


def disparities_of(inverse_depth: Tensor) -> list[Tensor]:
    """Four scales of the sigmoid output that stands for an inverse depth."""
    inverse_depth = inverse_depth.clamp(0.01, 10.0)
    finest: Tensor = (inverse_depth - 0.01) / (10.0 - 0.01)
    return [finest, *(torch.nn.functional.avg_pool2d(finest, 2**scale) for scale in (1, 2, 3))]


def loss(scene: RenderedTriplet, depth_factor: Tensor, transforms: tuple[Tensor, ...]) -> Tensor:
    """The whole loss, without smoothness, if all depths are wrong by one factor."""
    return photometric_loss(
        disparities_of(scene.depth_m.reciprocal() / depth_factor),
        scene.target,
        scene.sources,
        scene.intrinsics,
        transforms,
        WITHOUT_SMOOTHNESS,
    ).total


@pytest.mark.parametrize("source", [0, 1])
def test_true_depth_and_pose_rebuild_the_frame(scene: RenderedTriplet, source: int) -> None:
    visible = scene.visible(source)
    assert float(visible.float().mean()) > 0.5
    transform = scene.source_from_target[source]
    rebuilt = reproject(scene.sources[source], scene.depth_m, scene.intrinsics, transform)
    difference = (rebuilt - scene.target).abs().mean(dim=1, keepdim=True)
    assert float(difference[visible].mean()) < DIFFERENCE_LIMIT
    assert error(scene, scene.depth_m, transform, source) < REBUILT_LIMIT


def _twice_as_far(transform: Tensor) -> Tensor:
    wrong = transform.clone()
    wrong[:, :3, 3] *= 2.0
    return wrong


def _backwards(transform: Tensor) -> Tensor:
    wrong = transform.clone()
    wrong[:, :3, 3] *= -1.0
    return wrong


def _two_degrees_off(transform: Tensor) -> Tensor:
    return transform_from_pose(torch.tensor([[0.0, math.radians(2.0), 0.0, 0.0, 0.0, 0.0]])) @ transform


def _undone(transform: Tensor) -> Tensor:
    return torch.linalg.inv(transform)


@pytest.mark.parametrize("source", [0, 1])
@pytest.mark.parametrize("wrong", [_twice_as_far, _backwards, _two_degrees_off, _undone])
def test_a_wrong_pose_does_not(
    scene: RenderedTriplet, source: int, wrong: Callable[[Tensor], Tensor]
) -> None:
    transform = scene.source_from_target[source]
    truth = error(scene, scene.depth_m, transform, source)
    assert error(scene, scene.depth_m, wrong(transform), source) > 4.0 * truth


@pytest.mark.parametrize("source", [0, 1])
@pytest.mark.parametrize("factor", [0.8, 0.9, 1.1, 1.25])
def test_a_wrong_depth_does_not(scene: RenderedTriplet, source: int, factor: float) -> None:
    transform = scene.source_from_target[source]
    truth = error(scene, scene.depth_m, transform, source)
    assert error(scene, factor * scene.depth_m, transform, source) > 1.1 * truth


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_the_gradient_points_at_the_true_depth(scene: RenderedTriplet, factor: float) -> None:
    scale = torch.tensor(factor, requires_grad=True)
    value = loss(scene, scale, scene.source_from_target)
    value.backward()  # type: ignore[no-untyped-call]
    assert scale.grad is not None
    assert math.copysign(1.0, float(scale.grad)) == math.copysign(1.0, factor - 1.0)
    assert float(value.detach()) > float(loss(scene, torch.tensor(1.0), scene.source_from_target))


@pytest.mark.parametrize("start", [0.7, 1.4])
def test_descending_the_loss_finds_the_scale_of_the_depth(scene: RenderedTriplet, start: float) -> None:
    log_scale = torch.tensor(math.log(start), requires_grad=True)
    optimizer = torch.optim.Adam([log_scale], lr=0.03)
    for _ in range(50):
        optimizer.zero_grad()
        loss(scene, log_scale.exp(), scene.source_from_target).backward()  # type: ignore[no-untyped-call]
        optimizer.step()
    assert math.exp(float(log_scale.detach())) == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize("source", [0, 1])
def test_descending_the_loss_finds_the_pose(scene: RenderedTriplet, source: int) -> None:
    """From 1.5 degrees and 15 cm off to a tenth of a degree and 3 cm, with the true depth."""
    off = torch.tensor([[0.015, -0.02, 0.01, 0.1, -0.08, 0.08]]).requires_grad_()
    disparities = disparities_of(scene.depth_m.reciprocal())
    optimizer = torch.optim.Adam([off], lr=0.01)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, 100)
    for _ in range(100):
        optimizer.zero_grad()
        transform = transform_from_pose(off) @ scene.source_from_target[source]
        photometric_loss(
            disparities,
            scene.target,
            scene.sources[source : source + 1],
            scene.intrinsics,
            [transform],
            WITHOUT_SMOOTHNESS,
        ).total.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
    assert float(off.detach()[:, :3].norm()) < math.radians(0.1)
    assert float(off.detach()[:, 3:].norm()) < 0.03


def test_what_one_neighbour_hides_the_other_explains(scene: RenderedTriplet) -> None:
    """Pixels that only one source shows: their minimum is as good as anywhere, their mean is not."""
    errors = torch.stack(
        [
            photometric_error(
                reproject(source, scene.depth_m, scene.intrinsics, transform), scene.target, 0.85
            )
            for source, transform in zip(scene.sources, scene.source_from_target, strict=True)
        ]
    )
    once = scene.visible(0) ^ scene.visible(1)
    assert int(once.sum()) > 500
    minimum = float(over_sources(errors, minimum=True)[once].mean())
    assert minimum < REBUILT_LIMIT
    assert float(over_sources(errors, minimum=False)[once].mean()) > 2.0 * minimum
