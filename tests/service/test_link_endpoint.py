"""The endpoint's words, and the settings that hold them."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from service.autopilot.endpoint import (
    Endpoint,
    SerialEndpoint,
    TcpEndpoint,
    UdpListenEndpoint,
    UdpSendEndpoint,
    parse_endpoint,
)
from service.errors import LinkError
from service.settings.autopilot import AutopilotSettings


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udp:0.0.0.0:14550", UdpListenEndpoint("0.0.0.0", 14550)),
        ("udp:127.0.0.1:0", UdpListenEndpoint("127.0.0.1", 0)),
        ("udpout:192.168.1.5:14551", UdpSendEndpoint("192.168.1.5", 14551)),
        ("tcp:sitl.local:5760", TcpEndpoint("sitl.local", 5760)),
        ("tcp:[::1]:5760", TcpEndpoint("::1", 5760)),
        ("serial:/dev/ttyAMA0:921600", SerialEndpoint("/dev/ttyAMA0", 921600)),
        (
            "serial:/dev/serial/by-id/usb-a:b-if00:57600",
            SerialEndpoint("/dev/serial/by-id/usb-a:b-if00", 57600),
        ),
    ],
)
def test_every_form_is_understood_and_says_itself(text: str, endpoint: Endpoint) -> None:
    assert parse_endpoint(text) == endpoint
    assert str(endpoint) == text


@pytest.mark.parametrize(
    "text",
    [
        "",
        "udp",
        "udp:",
        "udp:14550",
        "udp::14550",
        "udp:0.0.0.0:",
        "udp:0.0.0.0:65536",
        "udp:0.0.0.0:-1",
        "udp:0.0.0.0:1e3",
        "udp:0.0.0.0:14550 ",
        "udp:0.0.0.0:٣",
        "tcp:host:0",
        "tcp:a b:5760",
        "tcp:a..b:5760",
        "tcp:" + "x" * 70 + ":5760",
        "tcp:::1:5760",
        "tcp:[]:5760",
        "udpin:0.0.0.0:14550",
        "TCP:host:5760",
        "serial:/dev/ttyUSB0",
        "serial:/dev/ttyUSB0:fast",
        "serial:/dev/ttyUSB0:0",
        "serial::57600",
        "/dev/ttyUSB0",
    ],
)
def test_anything_else_is_refused_with_the_value_and_the_forms(text: str) -> None:
    with pytest.raises(LinkError) as caught:
        parse_endpoint(text)
    assert repr(text) in str(caught.value)
    assert "udp:HOST:PORT (listen), udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD" in str(
        caught.value
    )


@given(st.text(max_size=60))
def test_any_text_is_understood_or_refused(text: str) -> None:
    for candidate in (text, f"udp:{text}:14550", f"tcp:host:{text}", f"serial:{text}"):
        with suppress(LinkError):
            assert parse_endpoint(str(parse_endpoint(candidate))) == parse_endpoint(candidate)


def test_settings_refuse_a_wrong_endpoint_by_key() -> None:
    with pytest.raises(ValidationError, match=r"endpoint\n.*'com3' is not understood"):
        AutopilotSettings(endpoint="com3")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("obstacle_rate_hz", 9.0),
        ("obstacle_rate_hz", 31.0),
        ("max_frame_age_s", 0.5),
        ("system_id", 256),
        ("attitude_rate_hz", "fast"),
        ("heartbeat_timeout_s", float("nan")),
        ("baud", 57600),
    ],
)
def test_settings_refuse_what_is_out_of_bounds(key: str, value: object) -> None:
    with pytest.raises(ValidationError, match=key):
        AutopilotSettings.model_validate({key: value})


def test_every_setting_has_a_title_and_a_sentence() -> None:
    for name, field in AutopilotSettings.model_fields.items():
        assert field.title, name
        assert field.description, name
