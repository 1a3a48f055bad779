"""The loss as a whole: what teaches, what does not, and what it refuses."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from training.errors import PhotometricSettingsError, PhotometricShapeError
from training.networks.disparity import disparity_to_depth
from training.photometric import (
    PhotometricSettings,
    PhotometricTerms,
    kernel_choice,
    photometric_loss,
    reproject,
    transform_from_pose,
)
from training.photometric.appearance import photometric_error

WIDTH, HEIGHT = 32, 16
SETTINGS = PhotometricSettings()
STILL = torch.zeros(2, 6)


def camera(count: int = 2) -> Tensor:
    return torch.tensor([[20.0, 0.0, 15.5], [0.0, 20.0, 7.5], [0.0, 0.0, 1.0]]).expand(count, 3, 3)


def picture(seed: int) -> Tensor:
    return torch.rand(2, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(seed))


def constant_disparities(value: float) -> list[Tensor]:
    return [torch.full((2, 1, HEIGHT >> s, WIDTH >> s), value).requires_grad_() for s in range(4)]


def random_disparities(seed: int) -> list[Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return [
        (0.2 * torch.rand(2, 1, HEIGHT >> s, WIDTH >> s, generator=generator)).requires_grad_()
        for s in range(4)
    ]


def loss_of(
    disparities: list[Tensor],
    target: Tensor,
    sources: list[Tensor],
    poses: list[Tensor],
    settings: PhotometricSettings = SETTINGS,
) -> PhotometricTerms:
    transforms = [transform_from_pose(pose) for pose in poses]
    return photometric_loss(disparities, target, sources, camera(), transforms, settings)


def test_the_total_is_reprojection_plus_weighted_smoothness() -> None:
    terms = loss_of(random_disparities(1), picture(1), [picture(2), picture(3)], [STILL, STILL])
    assert float(terms.total.detach()) == pytest.approx(
        float(terms.reprojection.detach()) + 0.04 * float(terms.smoothness.detach()), rel=1e-6
    )


def test_without_mask_or_choice_it_is_the_mean_error_of_the_rebuilt_pictures() -> None:
    """Each scale is up-sampled to the full picture first and becomes depth as `disparity_to_depth` says."""
    disparities, target, source = random_disparities(4), picture(1), picture(2)
    pose = torch.full((2, 6), 0.02)
    terms = loss_of(disparities, target, [source], [pose], replace(SETTINGS, auto_mask=False))
    errors = []
    for disparity in disparities:
        full = torch.nn.functional.interpolate(
            disparity, (HEIGHT, WIDTH), mode="bilinear", align_corners=False
        )
        rebuilt = reproject(source, disparity_to_depth(full), camera(), transform_from_pose(pose))
        errors.append(photometric_error(rebuilt, target, 0.85).mean())
    assert float(terms.reprojection.detach()) == pytest.approx(float(sum(errors).detach()) / 4, rel=1e-5)  # type: ignore[union-attr]
    assert bool(terms.auto_mask.all())


def test_smoothness_counts_half_as_much_on_each_coarser_scale() -> None:
    def of_scale(scale: int) -> float:
        disparities = constant_disparities(0.1)
        with torch.no_grad():
            disparities[scale][..., : disparities[scale].shape[-1] // 2] = 0.3
        flat = torch.full((2, 3, HEIGHT, WIDTH), 0.5)
        return float(loss_of(disparities, flat, [flat], [STILL]).smoothness.detach())

    # One step of height 1 over W - 1 gaps, divided by 2^s, mean of four scales.
    for scale in range(4):
        assert of_scale(scale) == pytest.approx(1.0 / ((WIDTH >> scale) - 1) / 2**scale / 4, rel=1e-4)


def test_a_camera_that_stands_still_teaches_nothing() -> None:
    target = picture(1)
    disparities = random_disparities(2)
    poses = [(0.01 * torch.ones(2, 6)).requires_grad_() for _ in range(2)]
    terms = loss_of(disparities, target, [target, target], poses)
    assert not bool(terms.auto_mask.any())
    terms.reprojection.backward()  # type: ignore[no-untyped-call]
    for tensor in (*disparities, *poses):
        assert tensor.grad is not None
        assert float(tensor.grad.abs().max()) == 0.0


@pytest.mark.parametrize("level", [0.0, 0.3, 0.97, 1.0])
def test_rounding_in_a_flat_picture_teaches_nothing(level: float) -> None:
    flat = torch.full((2, 3, HEIGHT, WIDTH), level)
    terms = loss_of(random_disparities(2), flat, [flat, flat], [torch.full((2, 6), 0.01)] * 2)
    assert not bool(terms.auto_mask.any())


def test_next_to_no_motion_is_no_explanation() -> None:
    """A source that is warped to where it was differs from itself by rounding, which must not teach."""
    speck = STILL + 1e-7
    terms = loss_of(random_disparities(2), picture(1), [picture(2), picture(3)], [speck, speck])
    assert not bool(terms.auto_mask.any())


def test_what_moves_with_the_camera_is_masked_and_the_rest_teaches() -> None:
    """The right half of the picture stays as it is (a rotor guard), the left half shifts by two pixels."""
    target = picture(1)
    source = target.roll(2, dims=3)
    source[..., WIDTH // 2 :] = target[..., WIDTH // 2 :]
    step = torch.zeros(2, 6)
    step[:, 3] = 2.0 * 5.0 / 20.0
    disparity = (1.0 / 5.0 - 0.01) / (10.0 - 0.01)
    mask = loss_of(constant_disparities(disparity), target, [source], [step]).auto_mask
    assert float(mask[..., 3 : WIDTH // 2 - 3].float().mean()) > 0.95
    assert not bool(mask[..., WIDTH // 2 + 1 :].any())


def test_without_the_mask_the_still_camera_does_teach() -> None:
    disparities, target = random_disparities(2), picture(1)
    pose = torch.full((2, 6), 0.01)
    loss_of(disparities, target, [target], [pose], replace(SETTINGS, auto_mask=False)).total.backward()  # type: ignore[no-untyped-call]
    assert disparities[0].grad is not None
    assert float(disparities[0].grad.abs().max()) > 0.0


def test_a_masked_pixel_costs_what_its_unwarped_source_does() -> None:
    """The loss is a minimum: making the warped picture worse cannot lower it."""
    target, source = picture(1), picture(2)
    good = loss_of(constant_disparities(0.0), target, [source], [STILL])
    wild = loss_of(constant_disparities(0.5), target, [source], [torch.ones(2, 6)])
    unwarped = float(photometric_error(source, target, 0.85).mean())
    assert float(good.reprojection.detach()) == pytest.approx(unwarped, rel=1e-3)
    assert float(wild.reprojection.detach()) <= unwarped


@pytest.mark.parametrize("minimum", [True, False])
@pytest.mark.parametrize("auto_mask", [True, False])
def test_without_numba_the_loss_is_the_same(
    minimum: bool, auto_mask: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = replace(SETTINGS, minimum=minimum, auto_mask=auto_mask)

    def values() -> list[Tensor]:
        disparities = random_disparities(5)
        pose = torch.full((2, 6), 0.05).requires_grad_()
        terms = loss_of(disparities, picture(1), [picture(2), picture(3)], [pose, 2.0 * pose], settings)
        terms.total.backward()  # type: ignore[no-untyped-call]
        return [terms.total.detach(), terms.auto_mask, *(each.grad for each in (*disparities, pose))]  # type: ignore[list-item]

    with_kernels = values()
    monkeypatch.setattr(kernel_choice, "_kernels", lambda: None)
    for ours, theirs in zip(with_kernels, values(), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("disparity", [0.0, 1.0])
@pytest.mark.parametrize("level", [None, 0.0, 1.0])
@pytest.mark.parametrize("pose", [0.0, 0.01, -3.0, 1e3])
def test_extreme_inputs_give_finite_losses_and_gradients(
    disparity: float, level: float | None, pose: float
) -> None:
    """Depths of 100 and 0.1 m, black, white and noisy pictures, no motion and absurd motion."""
    disparities = constant_disparities(disparity)
    motion = torch.full((2, 6), pose).requires_grad_()
    pictures = [picture(k) if level is None else torch.full((2, 3, HEIGHT, WIDTH), level) for k in range(3)]
    for settings in (SETTINGS, replace(SETTINGS, auto_mask=False, minimum=False)):
        terms = loss_of(disparities, pictures[0], pictures[1:], [motion, -motion], settings)
        terms.total.backward()  # type: ignore[no-untyped-call]
        assert math.isfinite(float(terms.total.detach()))
    for tensor in (*disparities, motion):
        assert tensor.grad is not None
        assert bool(torch.isfinite(tensor.grad).all())


def test_the_memory_order_of_the_pictures_does_not_matter() -> None:
    pictures = [picture(k) for k in range(3)]
    interleaved = [each.contiguous(memory_format=torch.channels_last) for each in pictures]
    totals = [
        float(loss_of(random_disparities(1), each[0], each[1:], [STILL + 0.02] * 2).total.detach())
        for each in (pictures, interleaved)
    ]
    assert totals[0] == totals[1]


def test_a_batch_costs_the_mean_of_its_pictures() -> None:
    disparities, target, source = random_disparities(1), picture(1), picture(2)
    both = loss_of(disparities, target, [source], [STILL + 0.02]).total.detach()
    transform = transform_from_pose(torch.full((1, 6), 0.02))
    alone = [
        photometric_loss(
            [each[k : k + 1] for each in disparities],
            target[k : k + 1],
            [source[k : k + 1]],
            camera(1),
            [transform],
            SETTINGS,
        ).total.detach()
        for k in range(2)
    ]
    torch.testing.assert_close(both, (alone[0] + alone[1]) / 2)


def test_transforms_in_double_precision_are_welcome() -> None:
    disparities, pose = random_disparities(1), STILL + 0.02
    single = loss_of(disparities, picture(1), [picture(2)], [pose]).total.detach()
    double = loss_of(disparities, picture(1), [picture(2)], [pose.double()]).total.detach()
    assert double.dtype == torch.float32
    torch.testing.assert_close(double, single, rtol=1e-4, atol=0)


def test_autocast_does_not_change_the_loss() -> None:
    arguments = (random_disparities(1), picture(1), [picture(2)], [STILL + 0.02])
    expected = loss_of(*arguments).total.detach()
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(loss_of(*arguments).total.detach(), expected)


class TestBadInput:
    @pytest.fixture
    def batch(self) -> dict[str, object]:
        return {
            "disparities": constant_disparities(0.1),
            "target": picture(1),
            "sources": [picture(2), picture(3)],
            "intrinsics": camera(),
            "source_from_target": [transform_from_pose(STILL)] * 2,
            "settings": SETTINGS,
        }

    @pytest.mark.parametrize(
        ("name", "value", "texts"),
        [
            ("disparities", [], ["0 disparities"]),
            ("sources", [], ["0 sources"]),
            ("source_from_target", [torch.eye(4).expand(2, 4, 4)], ["2 sources, 1 transforms"]),
            ("sources", [torch.zeros(2, 3, 8, 8)] * 2, ["(2, 3, 8, 8)", "(2, 3, 16, 32)"]),
            ("disparities", [torch.zeros(2, 1, 16, 31)], ["(2, 1, 16, 31)", "(2, 1, 16, 32)"]),
            ("disparities", [torch.zeros(2, 1, 16, 32)] * 2, ["scale 1", "(2, 1, 8, 16)"]),
            ("intrinsics", torch.eye(3)[None], ["intrinsics", "(1, 3, 3)", "(2, 3, 3)"]),
            ("source_from_target", [torch.eye(4)] * 2, ["source_from_target", "(4, 4)", "(2, 4, 4)"]),
        ],
    )
    def test_the_error_names_both_shapes(
        self, batch: dict[str, object], name: str, value: object, texts: list[str]
    ) -> None:
        batch[name] = value
        with pytest.raises(PhotometricShapeError) as caught:
            photometric_loss(**batch)  # type: ignore[arg-type]
        for text in texts:
            assert text in str(caught.value)

    @pytest.mark.parametrize(
        "wrong",
        [
            {"alpha": 1.2},
            {"alpha": math.nan},
            {"smoothness": -0.1},
            {"min_depth_m": 0.0},
            {"min_depth_m": 5.0, "max_depth_m": 5.0},
        ],
    )
    def test_settings_without_meaning_are_refused(self, wrong: dict[str, float]) -> None:
        with pytest.raises(PhotometricSettingsError):
            PhotometricSettings(**wrong)  # type: ignore[arg-type]
