"""Batches of triplets: a function of seed and number, exact in geometry, decoded once."""

from __future__ import annotations

import threading
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch
from sequence_files import CAMERA, CountedSequence, picture, write_airsim, write_picture

from training.errors import TrainingDataError, TrainingSettingsError
from training.sequences.airsim import open_airsim
from training.sequences.frame_cache import FrameCache, resized
from training.sequences.triplet_loader import LoaderSettings, TripletBatch, TripletLoader
from training.sequences.triplets import TripletSet

WIDTH, HEIGHT = 32, 24


@pytest.fixture(name="sequence")
def make_sequence(tmp_path: Path) -> CountedSequence:
    """Twelve frames, ten triplets."""
    (recording,) = open_airsim(write_airsim(tmp_path / "flight", 12))
    return CountedSequence(recording, [])


@pytest.fixture(name="triplets")
def make_triplets(sequence: CountedSequence) -> TripletSet:
    return TripletSet.from_sequences([sequence])


def tensors(batch: TripletBatch) -> list[torch.Tensor]:
    return [
        batch.target,
        *batch.sources,
        batch.target_jittered,
        *batch.sources_jittered,
        batch.intrinsics,
    ]


def same(first: TripletBatch, second: TripletBatch) -> bool:
    return all(torch.equal(a, b) for a, b in zip(tensors(first), tensors(second), strict=True))


def frame(number: int) -> torch.Tensor:
    """(3, H, W) what frame `number` looks like to a network."""
    rgb = resized(picture(number), WIDTH, HEIGHT)[:, :, ::-1]
    return torch.from_numpy(rgb.astype(np.float32) / 255.0).permute(2, 0, 1)


def numbers(batch: TripletBatch) -> list[int]:
    """Which frames the targets are, mirrored or not."""
    known = torch.stack([frame(number) for number in range(12)])
    both = torch.stack([known, known.flip(3)])
    gaps = [(both - target).abs().mean(dim=(2, 3, 4)) for target in batch.target]
    return [int(gap.argmin()) % 12 for gap in gaps]


def test_a_batch_holds_three_consecutive_frames_in_order(triplets: TripletSet, tmp_path: Path) -> None:
    loader = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 4, augment=False), tmp_path / "cache")
    batch = loader.batch(0)
    for row, number in enumerate(numbers(batch)):
        torch.testing.assert_close(batch.target[row], frame(number))
        torch.testing.assert_close(batch.sources[0][row], frame(number - 1))
        torch.testing.assert_close(batch.sources[1][row], frame(number + 1))
    assert torch.equal(batch.target, batch.target_jittered)
    for each in (batch.target, *batch.sources, batch.target_jittered, *batch.sources_jittered):
        assert each.shape == (4, 3, HEIGHT, WIDTH)
        assert each.dtype == torch.float32
        assert each.is_contiguous(memory_format=torch.channels_last)


def test_an_epoch_draws_every_triplet_once_and_epochs_differ(triplets: TripletSet, tmp_path: Path) -> None:
    loader = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 5), tmp_path / "cache")
    assert loader.batches_per_epoch == 2
    epochs = [numbers(loader.batch(2 * epoch)) + numbers(loader.batch(2 * epoch + 1)) for epoch in range(3)]
    for epoch in epochs:
        assert sorted(epoch) == list(range(1, 11))
    assert len({tuple(epoch) for epoch in epochs}) == 3


def test_a_batch_may_begin_in_one_epoch_and_end_in_the_next(triplets: TripletSet, tmp_path: Path) -> None:
    loader = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 4), tmp_path / "cache")
    assert loader.batches_per_epoch == 3
    drawn = [number for batch in range(5) for number in numbers(loader.batch(batch))]
    assert sorted(drawn[:10]) == sorted(drawn[10:]) == list(range(1, 11))


def test_a_set_smaller_than_a_batch_fills_it_by_going_round(triplets: TripletSet, tmp_path: Path) -> None:
    few = TripletSet(triplets.triplets[:2])
    batch = TripletLoader(few, LoaderSettings(WIDTH, HEIGHT, 6), tmp_path / "cache").batch(3)
    assert sorted(numbers(batch)) == [1, 1, 1, 2, 2, 2]


def test_batches_are_a_function_of_seed_and_number(triplets: TripletSet, tmp_path: Path) -> None:
    settings = LoaderSettings(WIDTH, HEIGHT, 4, seed=3)
    first = TripletLoader(triplets, settings, tmp_path / "cache")
    second = TripletLoader(triplets, settings, tmp_path / "another cache")
    backwards = [second.batch(number) for number in reversed(range(6))][::-1]
    for number, expected in enumerate(backwards):
        assert same(first.batch(number), expected)
    other = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 4, seed=4), tmp_path / "cache")
    assert not same(other.batch(0), backwards[0])


def test_resuming_at_a_number_goes_on_with_that_batch(triplets: TripletSet, tmp_path: Path) -> None:
    settings = LoaderSettings(WIDTH, HEIGHT, 4)
    whole = list(TripletLoader(triplets, settings, tmp_path / "cache").stream(0, 9))
    resumed = list(TripletLoader(triplets, settings, tmp_path / "cache").stream(6, 9))
    assert len(whole) == 9
    assert all(same(a, b) for a, b in zip(resumed, whole[6:], strict=True))


def test_leaving_a_stream_early_ends_its_thread(triplets: TripletSet, tmp_path: Path) -> None:
    loader = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 4), tmp_path / "cache")
    stream = loader.stream()
    assert len(list(islice(stream, 2))) == 2
    assert any(thread.name.startswith("triplets") for thread in threading.enumerate())
    stream.close()
    assert not any(thread.name.startswith("triplets") for thread in threading.enumerate())


def test_the_parts_of_all_processes_are_the_batch_of_one(triplets: TripletSet, tmp_path: Path) -> None:
    alone = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 6), tmp_path / "cache").batch(2)
    for rank in range(3):
        settings = LoaderSettings(WIDTH, HEIGHT, 6, rank=rank, world_size=3)
        part = TripletLoader(triplets, settings, tmp_path / "cache").batch(2)
        for whole, own in zip(tensors(alone), tensors(part), strict=True):
            assert torch.equal(whole[rank::3], own)


def test_a_mirrored_triplet_has_mirrored_intrinsics(triplets: TripletSet, tmp_path: Path) -> None:
    """What stays the same is which ray a pixel's content lies on, but for the side it is on."""
    batch = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 10), tmp_path / "cache").batch(0)
    plain = torch.from_numpy(CAMERA.scaled(WIDTH, HEIGHT).matrix.astype(np.float32))
    assert plain[0, 2] != (WIDTH - 1) / 2
    seen = set()
    for row, number in enumerate(numbers(batch)):
        mirrored = not torch.allclose(batch.target[row], frame(number), atol=1e-6)
        seen.add(mirrored)
        columns = torch.arange(WIDTH, dtype=torch.float32)
        own = (columns - batch.intrinsics[row, 0, 2]) / batch.intrinsics[row, 0, 0]
        original = (columns - plain[0, 2]) / plain[0, 0]
        torch.testing.assert_close(own, -original.flip(0) if mirrored else original)
        frames = (batch.sources[0][row], batch.target[row], batch.sources[1][row])
        for step, each in zip((-1, 0, 1), frames, strict=True):
            expected = frame(number + step)
            torch.testing.assert_close(each, expected.flip(2) if mirrored else expected)
        torch.testing.assert_close(batch.intrinsics[row, 1:], plain[1:])
    assert seen == {True, False}


def test_intrinsics_follow_the_resizing(triplets: TripletSet, tmp_path: Path) -> None:
    """Pixel centres lie at whole numbers: the picture's middle, 31.5, is the small picture's 15.5."""
    settings = LoaderSettings(WIDTH, HEIGHT, 1, augment=False)
    k = TripletLoader(triplets, settings, tmp_path / "cache").batch(0).intrinsics[0]
    torch.testing.assert_close(k[0], torch.tensor([16.0, 0.0, (31.0 + 0.5) / 2 - 0.5]))
    torch.testing.assert_close(k[1], torch.tensor([0.0, 18.0, (24.0 + 0.5) / 2 - 0.5]))
    torch.testing.assert_close(k[2], torch.tensor([0.0, 0.0, 1.0]))


def test_a_point_lands_where_the_resized_intrinsics_say(tmp_path: Path) -> None:
    image = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    image[20:28, 40:48] = 255
    small = resized(image, WIDTH, HEIGHT)[..., 0].astype(float)
    ray = np.array([(43.5 - CAMERA.cx) / CAMERA.fx, (23.5 - CAMERA.cy) / CAMERA.fy, 1.0])
    rows, columns = np.indices(small.shape)
    centre = [(small * columns).sum() / small.sum(), (small * rows).sum() / small.sum(), 1.0]
    np.testing.assert_allclose(CAMERA.scaled(WIDTH, HEIGHT).matrix @ ray, centre)


def test_networks_see_one_recolouring_of_the_three_frames(triplets: TripletSet, tmp_path: Path) -> None:
    """The change is one affine map of colour for all three frames, where nothing is clipped."""
    batch = TripletLoader(triplets, LoaderSettings(WIDTH, HEIGHT, 10), tmp_path / "cache").batch(1)
    changed = 0
    for row in range(10):
        plain = torch.stack([batch.sources[0][row], batch.target[row], batch.sources[1][row]])
        own = torch.stack(
            [batch.sources_jittered[0][row], batch.target_jittered[row], batch.sources_jittered[1][row]]
        )
        colours, seen = (each.permute(0, 2, 3, 1).reshape(-1, 3) for each in (plain, own))
        inside = ((seen > 0.02) & (seen < 0.98)).all(dim=1)
        known = torch.cat([colours, torch.ones(len(colours), 1)], dim=1)
        fit = torch.linalg.lstsq(
            known[inside][: inside.sum() // 3], seen[inside][: inside.sum() // 3]
        ).solution
        assert (known[inside] @ fit - seen[inside]).abs().max() < 0.02
        changed += int(not torch.equal(plain, own))
    assert changed >= 7


def test_frames_are_decoded_once_and_never_again(
    triplets: TripletSet, sequence: CountedSequence, tmp_path: Path
) -> None:
    settings = LoaderSettings(WIDTH, HEIGHT, 5)
    loader = TripletLoader(triplets, settings, tmp_path / "cache")
    for number in range(4):
        loader.batch(number)
    assert sorted(sequence.decoded) == list(range(12))
    again = TripletLoader(triplets, settings, tmp_path / "cache")
    for number in range(2):
        again.batch(number)
    assert len(sequence.decoded) == 12


def test_a_changed_picture_or_another_size_gets_a_cache_of_its_own(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path / "flight", 3)

    def first_frame(width: int, height: int) -> np.ndarray:
        (recording,) = open_airsim(folder)
        return FrameCache(tmp_path / "cache", recording, width, height).rgb(0)

    old = first_frame(WIDTH, HEIGHT).copy()
    assert first_frame(16, 12).shape == (12, 16, 3)
    write_picture(folder / "images" / "img_0.png", 40)
    assert not np.array_equal(first_frame(WIDTH, HEIGHT), old)
    assert len(list((tmp_path / "cache").iterdir())) == 3


def test_a_frame_half_written_when_the_power_went_is_decoded_again(
    sequence: CountedSequence, tmp_path: Path
) -> None:
    whole = FrameCache(tmp_path / "cache", sequence, WIDTH, HEIGHT).rgb(3).copy()
    (pixels,) = (tmp_path / "cache").glob("*/frames.u8")
    with pixels.open("r+b") as file:
        file.seek(3 * whole.size + whole.size // 2)
        file.write(bytes(whole.size // 2))
    np.testing.assert_array_equal(FrameCache(tmp_path / "cache", sequence, WIDTH, HEIGHT).rgb(3), whole)
    assert sequence.decoded == [3, 3]


def test_a_cache_cut_short_is_refused_and_named(sequence: CountedSequence, tmp_path: Path) -> None:
    FrameCache(tmp_path / "cache", sequence, WIDTH, HEIGHT)
    (sums,) = (tmp_path / "cache").glob("*/sums.u64")
    sums.unlink()
    with pytest.raises(TrainingDataError, match=r"decoded frames in .*flight-32x24"):
        FrameCache(tmp_path / "cache", sequence, WIDTH, HEIGHT)


def test_a_cache_that_cannot_be_written_is_named_with_its_size(
    sequence: CountedSequence, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(TrainingDataError, match=r"cannot keep 5 MB of decoded frames in .*file"):
        FrameCache(tmp_path / "file", sequence, 400, 350)


def test_a_full_disk_is_said_before_anything_is_decoded(
    sequence: CountedSequence, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int, offset: int, size: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(TrainingDataError, match="No space left on device"):
        FrameCache(tmp_path / "cache", sequence, WIDTH, HEIGHT)
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_broken_picture_is_replaced_by_the_next_triplet_and_named(
    sequence: CountedSequence, tmp_path: Path
) -> None:
    broken = CountedSequence(sequence.inner, [], frozenset({4}))
    settings = LoaderSettings(WIDTH, HEIGHT, 5)
    loader = TripletLoader(TripletSet.from_sequences([broken]), settings, tmp_path / "cache")
    batches = [loader.batch(number) for number in range(2)]
    assert sorted(number for batch in batches for number in numbers(batch)) == [1, 2, 6, 6, 6, 6, 7, 8, 9, 10]
    assert [(Path(file).name, reason) for file, reason in loader.skipped] == [
        ("img_4.png", "frame 4 is broken")
    ]
    again = TripletLoader(TripletSet.from_sequences([broken]), settings, tmp_path / "cache")
    assert same(again.batch(1), batches[1])


def test_a_set_of_broken_pictures_only_is_refused(sequence: CountedSequence, tmp_path: Path) -> None:
    broken = CountedSequence(sequence.inner, [], frozenset(range(12)))
    loader = TripletLoader(
        TripletSet.from_sequences([broken]), LoaderSettings(WIDTH, HEIGHT, 2), tmp_path / "cache"
    )
    with pytest.raises(TrainingDataError, match="not one of 10 triplets can be read"):
        next(loader.stream())


def test_no_triplets_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no triplets"):
        TripletLoader(TripletSet(()), LoaderSettings(WIDTH, HEIGHT), tmp_path / "cache")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"width": 0}, "width is 0"),
        ({"batch_size": 0}, "batch_size is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"rank": 2, "world_size": 2}, "rank is 2"),
        ({"batch_size": 9, "world_size": 2}, "9 cannot be shared out evenly to 2"),
    ],
)
def test_impossible_settings_are_refused(changes: dict[str, int], said: str) -> None:
    with pytest.raises(TrainingSettingsError, match=said):
        LoaderSettings(**({"width": WIDTH, "height": HEIGHT} | changes))  # type: ignore[arg-type]
