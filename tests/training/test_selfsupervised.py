"""The paper's training: settings, exact resume, checkpoints that are refused, several processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest
import torch
from lightning_fabric import Fabric
from recordings import write_wall_recording
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch import Tensor

from training.errors import CheckpointError, TrainingSettingsError
from training.selfsupervised import command
from training.selfsupervised.frames import open_triplets
from training.selfsupervised.run_board import shown
from training.selfsupervised.run_state import RunState
from training.selfsupervised.settings import SelfSupervisedSettings, load_settings, parse_settings
from training.selfsupervised.trainer import SelfSupervisedTrainer

MakeTrainer = Callable[..., SelfSupervisedTrainer]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_wall_recording(tmp_path_factory.mktemp("recordings") / "wall")


@pytest.fixture
def settings(recording: Path, tmp_path: Path) -> Callable[..., SelfSupervisedSettings]:
    def make(**changes: object) -> SelfSupervisedSettings:
        table: dict[str, object] = {
            "sources": [{"kind": "airsim", "path": str(recording)}],
            "network": {"name": "bl"},
            "width": 96,
            "height": 64,
            "batch": 2,
            "image_steps": 8,
            "cache": str(tmp_path / "cache"),
        }
        return parse_settings({**table, **changes}, "test")

    return make


def make_trainer(settings: SelfSupervisedSettings) -> SelfSupervisedTrainer:
    fabric = Fabric(accelerator="cpu", devices=1)
    fabric.launch()
    return SelfSupervisedTrainer(settings, open_triplets(settings.sources), fabric)


def weights(trainer: SelfSupervisedTrainer) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in trainer.networks.state_dict().items()}


class TestSettings:
    def test_defaults_are_the_papers(self, settings: Callable[..., SelfSupervisedSettings]) -> None:
        made = settings(image_steps=1000)
        assert made.loss.smoothness == 0.04
        assert made.loss.alpha == 0.85
        assert [made.rate_at(images) for images in (0, 749, 750, 999)] == pytest.approx(
            [1e-4, 1e-4, 1e-5, 1e-5]
        )

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ("widht = 96", "widht"),
            ("width = 100", "multiple of 32"),
            ("batch = 1", "batch"),
            ('network = {name = "resnet"}', "network.name"),
            ("learning_rate = nan", "learning_rate"),
            ("loss = {min_depth_m = 5.0, max_depth_m = 1.0}", "below max_depth_m"),
        ],
    )
    def test_a_wrong_key_is_named(self, tmp_path: Path, line: str, words: str) -> None:
        path = tmp_path / "run.toml"
        path.write_text(f'image_steps = 10\n{line}\n[[sources]]\nkind = "airsim"\npath = "flights"\n')
        with pytest.raises(TrainingSettingsError, match=words):
            load_settings(path)

    def test_paths_are_seen_from_the_file(self, tmp_path: Path) -> None:
        path = tmp_path / "run.toml"
        path.write_text('image_steps = 10\n[[sources]]\nkind = "airsim"\npath = "flights"\n')
        assert load_settings(path).sources[0].path == tmp_path / "flights"

    @pytest.mark.parametrize(
        ("content", "words"), [(None, "no configuration"), (b"= 3", "not TOML"), (b"\xff\xfe", "not TOML")]
    )
    def test_a_missing_or_broken_file_is_named(
        self, tmp_path: Path, content: bytes | None, words: str
    ) -> None:
        path = tmp_path / "run.toml"
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(TrainingSettingsError, match=words):
            load_settings(path)


class TestTraining:
    def test_a_resumed_run_ends_where_one_without_a_break_does(
        self, settings: Callable[..., SelfSupervisedSettings], tmp_path: Path
    ) -> None:
        whole = make_trainer(settings())
        for _ in whole.run():
            pass
        first = make_trainer(settings())
        steps = first.run()
        next(steps), next(steps)
        first.state().save(tmp_path / "half.pt")
        second = make_trainer(settings(seed=0))
        second.resume(RunState.load(tmp_path / "half.pt"))
        reports = list(second.run())
        assert [report.images for report in reports] == [6, 8]
        for name, value in weights(whole).items():
            assert torch.equal(value, second.networks.state_dict()[name]), name

    def test_the_loss_falls_on_a_wall_that_it_sees_again_and_again(
        self, settings: Callable[..., SelfSupervisedSettings]
    ) -> None:
        trainer = make_trainer(settings(image_steps=160, batch=4))
        losses = [float(report.terms.reprojection.detach()) for report in islice(trainer.run(), 32)]
        assert sum(losses[-10:]) < 0.8 * sum(losses[:10])

    def test_networks_start_alike_but_for_their_decoders(
        self, settings: Callable[..., SelfSupervisedSettings]
    ) -> None:
        one, other = (weights(make_trainer(settings(network={"name": name}))) for name in ("bl", "hr-depth"))
        common = [name for name in one if name.startswith(("pose.", "depth.encoder."))]
        assert len(common) > 100
        for name in common:
            assert torch.equal(one[name], other[name]), name


class TestCheckpoints:
    @pytest.fixture
    def checkpoint(self, settings: Callable[..., SelfSupervisedSettings], tmp_path: Path) -> Path:
        path = tmp_path / "checkpoint.pt"
        make_trainer(settings()).state().save(path)
        return path

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"network": {"name": "monodepth2"}}, "network is .*monodepth2.*was.*bl"),
            ({"width": 64}, "width is 64, was 96"),
            ({"loss": {"smoothness": 0.001}}, "loss is"),
        ],
    )
    def test_of_another_run_is_refused_by_what_differs(
        self,
        settings: Callable[..., SelfSupervisedSettings],
        checkpoint: Path,
        changes: dict[str, object],
        words: str,
    ) -> None:
        trainer = make_trainer(settings(**changes))
        with pytest.raises(CheckpointError, match=words):
            trainer.resume(RunState.load(checkpoint))

    def test_may_go_on_to_another_length(
        self, settings: Callable[..., SelfSupervisedSettings], checkpoint: Path
    ) -> None:
        trainer = make_trainer(settings(image_steps=4))
        trainer.resume(RunState.load(checkpoint))
        assert [report.images for report in trainer.run()] == [2, 4]

    @pytest.mark.parametrize("content", [b"", b"not a checkpoint", b"PK\x03\x04broken"])
    def test_broken_ones_are_refused(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "checkpoint.pt"
        path.write_bytes(content)
        with pytest.raises(CheckpointError, match=str(path)):
            RunState.load(path)

    def test_a_file_that_would_run_code_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "checkpoint.pt"
        torch.save({"format": "x", "settings": _Trap(tmp_path / "sprung")}, path)
        with pytest.raises(CheckpointError):
            RunState.load(path)
        assert not (tmp_path / "sprung").exists()

    def test_a_full_disk_leaves_the_old_one_whole(
        self,
        settings: Callable[..., SelfSupervisedSettings],
        checkpoint: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        def full(content: object, path: Path) -> None:
            path.write_bytes(b"half")
            raise RuntimeError("file write failed")

        monkeypatch.setattr(torch, "save", full)
        state = make_trainer(settings()).state()
        with pytest.raises(CheckpointError, match=r"cannot write.*file write failed"):
            state.save(checkpoint)
        assert RunState.load(checkpoint).images == 0
        assert list(checkpoint.parent.glob("*.part")) == []


class _Trap:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, (str(self.path),)


class TestCommand:
    @pytest.fixture
    def config(self, recording: Path, tmp_path: Path) -> Path:
        path = tmp_path / "run.toml"
        path.write_text(
            f'image_steps = 4\nbatch = 2\nwidth = 96\nheight = 64\ncache = "cache"\n'
            f'[network]\nname = "bl"\n[[sources]]\nkind = "airsim"\npath = "{recording}"\n'
        )
        return path

    def test_a_run_leaves_a_checkpoint_and_pictures(
        self, config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        output = tmp_path / "run"
        command.train_video(config, output)
        assert RunState.load(output / command.CHECKPOINT_NAME).images == 4
        shown_words = capsys.readouterr()
        assert "6 frames, 0 skipped" in shown_words.err
        assert "4 pictures in" in shown_words.out
        events = EventAccumulator(str(output / command.BOARD_NAME))
        events.Reload()
        assert set(events.Tags()["images"]) >= {"frame/target", "frame/disparity", "frame/auto_mask"}

    def test_a_second_run_does_not_overwrite_the_first(self, config: Path, tmp_path: Path) -> None:
        output = tmp_path / "run"
        command.train_video(config, output)
        with pytest.raises(TrainingSettingsError, match="--resume"):
            command.train_video(config, output)

    def test_two_processes_learn_the_same_network(self, config: Path, tmp_path: Path) -> None:
        """PyTorch's launcher; each process writes a digest of its weights, gradients shared or not."""
        script = tmp_path / "two.py"
        script.write_text(_TWO_PROCESSES)
        launcher = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
        subprocess.run(
            [*launcher, str(script), str(config), str(tmp_path)],
            check=True,
            timeout=150,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            capture_output=True,
        )
        learned = [torch.load(tmp_path / f"rank{rank}.pt", weights_only=True) for rank in (0, 1)]
        trained = [name for name in learned[0] if not name.endswith(("mean", "var", "tracked"))]
        for name in trained:
            assert torch.equal(learned[0][name], learned[1][name]), name
        # What normalisation saw differs: each process had pictures of its own.
        assert any(not torch.equal(learned[0][name], learned[1][name]) for name in learned[0])
        assert RunState.load(tmp_path / "run" / command.CHECKPOINT_NAME).images == 4


_TWO_PROCESSES = """
import os, sys
from pathlib import Path
import torch
from training.selfsupervised import command
from training.selfsupervised.settings import load_settings
from training.selfsupervised.trainer import SelfSupervisedTrainer
config, folder = Path(sys.argv[1]), Path(sys.argv[2])
settings = load_settings(config).model_copy(update={"batch": 4})
fabric = command.launch(settings)
assert fabric.world_size == 2, fabric.world_size
trainer = SelfSupervisedTrainer(settings, command.open_triplets(settings, quiet=True), fabric)
command.train(trainer, folder / "run", leads=fabric.is_global_zero)
torch.save(trainer.networks.state_dict(), folder / f"rank{fabric.global_rank}.pt")
"""


def test_nearer_is_lighter_in_pictures() -> None:
    disparity = torch.linspace(0.01, 0.2, 64).reshape(1, 1, 8, 8)
    picture = shown(disparity)
    assert picture.min() == 0.0
    assert picture.max() == 1.0
    assert torch.all(picture.flatten().diff() >= 0)
