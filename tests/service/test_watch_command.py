"""`uavdepth watch` as a user meets it."""

from __future__ import annotations

import json
import signal
from pathlib import Path

from command_line import LIMIT_S, started, uavdepth
from program_fakes import free_port
from program_files import write_config, write_pictures


def test_watch_once_without_a_vehicle_is_exit_code_1() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    done = uavdepth("watch", "--once", "--json", "--timeout", "0.2", "--connect", endpoint)
    assert done.returncode == 1
    assert json.loads(done.stdout) == {"vehicles": {}, "bad_samples": 0}


def test_watch_refuses_an_endpoint_that_is_none() -> None:
    done = uavdepth("watch", "--connect", "localhost")
    assert done.returncode == 2
    assert "--connect: 'localhost' is no endpoint" in done.stderr


def test_watch_sees_a_running_service_and_both_end_when_told_to(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = write_config(tmp_path, write_pictures(tmp_path / "pictures"), more="[vehicle]\nname = 'kite'\n")
    with started(
        "run",
        "--config",
        str(config),
        "--set",
        "camera.loop=true",
        "--set",
        "zenoh.enabled=true",
        "--set",
        f"zenoh.listen=['{endpoint}']",
    ) as service:
        once = uavdepth("watch", "--once", "--json", "--timeout", "30", "--connect", endpoint)
        assert once.returncode == 0, once.stderr
        kite = json.loads(once.stdout)["vehicles"]["kite"]
        assert kite["alive"]
        assert kite["scan"]["trusted"] is False
        assert kite["nearest_m"] is None
        assert kite["status"]["camera"] == "delivering"
        with started("watch", "--json", "--connect", endpoint) as watch:
            assert watch.stdout is not None
            watch.stdout.readline()
            watch.send_signal(signal.SIGINT)
            _, words = watch.communicate(timeout=LIMIT_S)
            assert watch.returncode == 0, words
        service.send_signal(signal.SIGTERM)
        service.communicate(timeout=LIMIT_S)
    assert service.returncode == 0
