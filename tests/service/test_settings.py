"""What the configuration accepts, and in which words it refuses."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import ConfigError
from service.settings import Settings
from service.settings.load import load_settings, parse_override, section_model, table_model
from service.settings.reference import example_toml, reference_markdown
from service.settings.zenoh import check_endpoint

CALIBRATED = "[camera]\nsource = '0'\nhorizontal_fov_deg = 80\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "drone.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "[camera] source: is missing"),
        ("[camera]\nsource = '0'\n", "[camera]: no calibration"),
        (CALIBRATED + "fps = 500\n", "[camera] fps: 500 is above 240"),
        (CALIBRATED + "fps = 0.5\n", "[camera] fps: 0.5 is below 1"),
        (CALIBRATED + "fps = '30 Hz'\n", "[camera] fps: '30 Hz' is not a number"),
        (CALIBRATED + "width = 640.5\n", "[camera] width: 640.5 is not a whole number"),
        (CALIBRATED + "loop = 1\n", "[camera] loop: 1 is not true or false"),
        (CALIBRATED + "widht = 640\n", "[camera] widht: unknown key; did you mean width?"),
        (CALIBRATED + "zzz = 1\n", "[camera] zzz: unknown key; known are"),
        (CALIBRATED + "[camra]\nfps = 3\n", "[camra]: unknown section; did you mean camera?"),
        (CALIBRATED + "fx = 300.0\n", "fx and horizontal_fov_deg are both given"),
        ("[camera]\nsource = '0'\nfx = 300.0\nfy = 300.0\n", "cx, cy missing"),
        (CALIBRATED + "distortion = [0.1, 0.2]\n", "[camera]: distortion has 2 numbers"),
        (CALIBRATED + "distortion = [0.1, 'a', 0, 0]\n", "[camera] distortion: 'a' is not a number"),
        (CALIBRATED + "fps = inf\n", "[camera] fps: inf is"),
        (CALIBRATED + "latency_ms = nan\n", "[camera] latency_ms: nan is not"),
        (CALIBRATED + "reopen_after_s = 9\n", "reopen_at_most_s: 5 is below reopen_after_s 9"),
        ("camera = 3\n", "[camera]: 3 is not a table"),
        ("[camera]\nsource = 0\n", "[camera] source: 0 is not text"),
        (CALIBRATED + "[vehicle]\nname = 'a/b'\n", "[vehicle] name: 'a/b' does not match"),
        (CALIBRATED + "[vehicle]\nname = '*'\n", "[vehicle] name: '*' does not match"),
        (CALIBRATED + "[model]\nprovider = 'abacus'\n", "[model] provider: 'abacus' is none of 'auto'"),
        (CALIBRATED + "[scan]\nmin_distance_m = 4.0\nmax_distance_m = 4.5\n", "at least 1 m above"),
        (
            CALIBRATED + "[zenoh]\nlisten = ['localhost:7447']\n",
            "[zenoh] listen: 'localhost:7447' is no endpoint",
        ),
        (CALIBRATED + "[zenoh]\nlisten = ['tcp/localhost:99999']\n", "has port 99999: 1 to 65535"),
        (CALIBRATED + "[zenoh]\nlisten = []\n", "listen and connect are both empty"),
        (CALIBRATED + "[zenoh]\ndepth_near_m = 10.0\ndepth_far_m = 5.0\n", "depth_far_m: 5 must be above"),
        (CALIBRATED + "[autopilot]\nendpoint = 'foo'\n", "[autopilot] endpoint: autopilot endpoint 'foo'"),
        (
            CALIBRATED + "[autopilot]\nobstacle_rate_hz = 5.0\n",
            "[autopilot] obstacle_rate_hz: 5.0 is below 10",
        ),
        (CALIBRATED + "[log]\nlevel = 'loud'\n", "[log] level: 'loud' is none of"),
        ("this is not toml", "not TOML"),
    ],
)
def test_a_wrong_file_is_refused_with_its_name_and_the_key(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as refusal:
        load_settings(path)
    assert words in str(refusal.value)
    assert str(path) in str(refusal.value)


def test_every_mistake_is_named_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, CALIBRATED + "fps = 500\n[scan]\nbelow_m = -1.0\n[log]\nform = 'json'\n")
    with pytest.raises(ConfigError) as refusal:
        load_settings(path)
    text = str(refusal.value)
    assert "[camera] fps" in text
    assert "[scan] below_m" in text
    assert "[log] form: unknown key; did you mean format?" in text


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nothing\.toml: no such file"):
        load_settings(tmp_path / "nothing.toml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_settings(tmp_path)


def test_a_file_that_is_not_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ConfigError, match="not UTF-8"):
        load_settings(path)


def test_a_small_file_is_enough(tmp_path: Path) -> None:
    settings = load_settings(write(tmp_path, CALIBRATED))
    assert settings.camera.source == "0"
    assert settings.autopilot.obstacle_rate_hz == 15.0
    assert settings.zenoh.listen == ("tcp/127.0.0.1:7447",)


def test_calibration_reaches_the_camera_model(tmp_path: Path) -> None:
    text = (
        "[camera]\nsource = '0'\nwidth = 320\nheight = 240\n"
        "fx = 300\nfy = 301\ncx = 160\ncy = 119.5\ndistortion = [0.1, 0.0, 0.0, 0.0]\n"
    )
    model = load_settings(write(tmp_path, text)).camera.model
    assert (model.fx, model.fy, model.cx, model.cy) == (300.0, 301.0, 160.0, 119.5)
    assert model.distortion == (0.1, 0.0, 0.0, 0.0)


def test_field_of_view_and_distortion_can_stand_together() -> None:
    settings = load_settings(
        None, ["camera.source=0", "camera.horizontal_fov_deg=90", "camera.distortion=[0.1,0,0,0]"]
    )
    assert settings.camera.model.fx == pytest.approx(320.0)
    assert settings.camera.model.distortion[0] == 0.1


def test_a_rendered_camera_needs_no_calibration() -> None:
    assert load_settings(None, ["camera.source=sim:city"]).camera.model.fx == pytest.approx(320.0)


def test_settings_never_change_after_they_were_read() -> None:
    settings = load_settings(None, ["camera.source=sim:city"])
    with pytest.raises(ValueError, match="frozen"):
        settings.camera.fps = 3.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "parsed"),
    [
        ("camera.fps=15", ("camera", "fps", 15)),
        ("camera.source=0", ("camera", "source", "0")),
        ("camera.source=rtsp://h/x=y", ("camera", "source", "rtsp://h/x=y")),
        ('camera.source="0"', ("camera", "source", "0")),
        ("zenoh.listen=['tcp/0.0.0.0:1']", ("zenoh", "listen", ["tcp/0.0.0.0:1"])),
        ("zenoh.enabled=false", ("zenoh", "enabled", False)),
        ("camera.fps=1\nx=2", ("camera", "fps", "1\nx=2")),
    ],
)
def test_overrides_are_read_as_their_key_needs(text: str, parsed: tuple[str, str, object]) -> None:
    assert parse_override(text) == parsed


@pytest.mark.parametrize("text", ["", "camera", "camera.fps", "fps=3", "a.b.c=3", ".fps=3", "camera.=3"])
def test_overrides_of_another_form_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"section\.key=value"):
        parse_override(text)


def test_an_override_wins_over_the_file_and_is_named_in_errors(tmp_path: Path) -> None:
    path = write(tmp_path, CALIBRATED)
    assert load_settings(path, ["camera.fps=12"]).camera.fps == 12.0
    with pytest.raises(ConfigError, match=r"drone\.toml and the command line"):
        load_settings(path, ["camera.fps=0"])


@given(st.text(max_size=40))
def test_no_text_is_an_endpoint_by_accident(text: str) -> None:
    try:
        check_endpoint(text)
    except ValueError:
        return
    assert text.startswith(("tcp/", "udp/"))


def test_the_example_is_a_valid_configuration_with_every_key(tmp_path: Path) -> None:
    text = example_toml()
    assert isinstance(load_settings(write(tmp_path, text)), Settings)
    for name in Settings.model_fields:
        assert f"[{name}]" in text
        section = section_model(name)
        for key in section.model_fields if section is not None else ():
            assert f"\n{key} = " in text or f"\n# {key} =" in text


def test_the_examples_values_are_the_defaults(tmp_path: Path) -> None:
    settings = load_settings(write(tmp_path, example_toml()))
    plain = load_settings(None, ["camera.source=0", "camera.horizontal_fov_deg=78.0"])
    assert settings == plain
    sections = {name for name in Settings.model_fields if section_model(name) is not None}
    assert set(tomllib.loads(example_toml())) == sections


def test_the_reference_describes_every_key_with_its_bounds() -> None:
    text = reference_markdown()
    for name in Settings.model_fields:
        section = section_model(name) or table_model(name)
        assert section is not None
        assert f"## [{name}]" in text or f"## [[{name}]]" in text
        for key, field in section.model_fields.items():
            assert f"| `{key}` |" in text
            assert field.title, f"[{name}] {key} has no title"
            assert field.description, f"[{name}] {key} has no description"
    assert "| `fps` | number, from 1.0 to 240.0 | `30.0` |" in text
