"""Parameters and operations of the networks, and the command that lists them."""

from __future__ import annotations

import json

import pytest
import torch
import typer
from torch import nn
from typer.testing import CliRunner

from training.networks.catalogue import NETWORK_NAMES, PROPOSED, build_network
from training.networks.counting import NetworkCost, count_multiply_adds, count_networks, count_parameters
from training.networks.pose_network import PoseNetwork
from training.networks_command import networks


def _at(network: nn.Module, width: int, height: int, pictures: int = 1) -> int:
    return count_multiply_adds(network, *(torch.empty(1, 3, height, width, device="meta"),) * pictures)


def test_a_convolution_costs_one_multiply_add_for_each_weight_and_output_pixel() -> None:
    network = nn.Conv2d(3, 8, 3, padding=1)
    assert count_parameters(network) == 3 * 8 * 9 + 8
    assert _at(network, 20, 10) == 3 * 8 * 9 * 20 * 10


def test_counting_leaves_the_network_as_it_was() -> None:
    network = nn.Conv2d(3, 1, 1)
    weight = network.weight.detach().clone()
    _at(network, 8, 8)
    assert network.training
    assert torch.equal(network.weight, weight)


def test_monodepth2_has_its_published_size() -> None:
    with torch.device("meta"):
        network = build_network("monodepth2")
    assert count_parameters(network) == pytest.approx(14.3e6, rel=0.005)
    assert _at(network, 640, 192) == pytest.approx(8.0e9, rel=0.005)


def test_the_proposed_network_is_lean() -> None:
    with torch.device("meta"):
        proposed, monodepth2 = build_network(PROPOSED), build_network("monodepth2")
    assert count_parameters(proposed) < 16e6
    assert _at(proposed, 640, 192) < 1.4 * _at(monodepth2, 640, 192)


def test_attention_without_reduction_costs_next_to_nothing() -> None:
    with torch.device("meta"):
        plain, squeezed, efficient = (
            count_parameters(build_network(name)) for name in ("bl+fan", "bl+fan+se", "bl+fan+eca")
        )
    # Five kernels: three of 3 and two of 5 channels.
    assert efficient - plain == 3 * 3 + 2 * 5
    assert squeezed - plain > 100 * (efficient - plain)


def test_a_pose_costs_less_than_half_a_depth() -> None:
    with torch.device("meta"):
        pose, depth = PoseNetwork(), build_network(PROPOSED)
    assert _at(pose, 128, 96, pictures=2) == pytest.approx(0.2e9, rel=0.1)
    assert 2 * _at(pose, 128, 96, pictures=2) < _at(depth, 128, 96)


@pytest.fixture(scope="module")
def costs() -> list[NetworkCost]:
    return count_networks()


def test_every_network_is_counted_at_both_sizes(costs: list[NetworkCost]) -> None:
    assert [cost.name for cost in costs] == [*NETWORK_NAMES, "pose", "flight"]
    for cost in costs:
        small, large = cost.pictures
        assert (small.width, small.height, large.width, large.height) == (384, 192, 640, 320)
        assert small.operations == 2 * small.multiply_adds
        # Convolutions cost as much as there are pixels; only the few dense layers do not.
        assert large.multiply_adds / small.multiply_adds == pytest.approx(640 * 320 / (384 * 192), rel=0.02)


def _run(arguments: list[str], costs: list[NetworkCost], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("training.networks.counting.count_networks", lambda: costs)
    app = typer.Typer()
    app.command()(networks)
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_prints_one_json_object(
    costs: list[NetworkCost], monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = json.loads(_run(["--json"], costs, monkeypatch))
    rows = {row["name"]: row for row in printed["networks"]}
    assert set(rows) == {*NETWORK_NAMES, "pose", "flight"}
    monodepth2 = rows["monodepth2"]
    assert monodepth2["encoder"] == "resnet18"
    first = monodepth2["pictures"][0]
    assert first["operations"] == 2 * first["multiply_adds"]


def test_the_command_prints_a_row_for_every_network(
    costs: list[NetworkCost], monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = _run([], costs, monkeypatch)
    for cost in costs:
        assert f" {cost.name} " in printed
        assert f" {cost.parameters / 1e6:.2f} " in printed
