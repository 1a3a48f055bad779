"""The page in a real browser."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from chromium import Chromium, Tab, chromium, needs_chromium
from ground_support import (
    RunningStation,
    Talk,
    Vehicle,
    camera_header,
    depth_header,
    depth_png,
    jpeg,
    station,
)

from service.publisher import keys

pytestmark = needs_chromium

TOKEN = "correct-horse-battery"
COUNT = "Number(document.getElementById('{}').dataset.count ?? 0)"


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def running() -> Iterator[RunningStation]:
    with station() as open_station:
        yield open_station


@pytest.fixture
def tab(browser: Chromium) -> Iterator[Tab]:
    with browser.tab() as fresh:
        yield fresh
        assert fresh.errors == []


def is_text(selector: str, text: str) -> str:
    return f"document.querySelector({json.dumps(selector)})?.textContent.includes({json.dumps(text)})"


def pixel(canvas: str, x: float, y: float) -> str:
    """Red, green, blue, opacity at a place given in shares of width and height."""
    return (
        f"(c => Array.from(c.getContext('2d').getImageData(c.width * {x}, c.height * {y}, 1, 1).data))"
        f"(document.getElementById('{canvas}'))"
    )


def luminance(rgba: list[int]) -> float:
    return 0.2126 * rgba[0] + 0.7152 * rgba[1] + 0.0722 * rgba[2]


def test_pictures_change_and_lighter_is_nearer(running: RunningStation, tab: Tab) -> None:
    kite = Vehicle(running.vehicles, "kite")
    shade, distance_m = [40], [30.0]
    with Talk(lambda: kite.say(distance_m[0], shade=shade[0])):
        tab.open(f"{running.url}/#vehicle=kite")
        tab.wait_for(f"{COUNT.format('camera')} > 0 && {COUNT.format('depth')} > 0")
        dark, far = tab.evaluate(pixel("camera", 0.5, 0.5)), tab.evaluate(pixel("depth", 0.8, 0.8))
        assert dark[0] == pytest.approx(40, abs=3)
        shade[0], distance_m[0] = 220, 2.0
        tab.wait_for(f"{pixel('camera', 0.5, 0.5)}[0] > 200")
        tab.wait_for(f"{pixel('depth', 0.8, 0.8)}[1] > 160")
        near = tab.evaluate(pixel("depth", 0.8, 0.8))
        assert luminance(near) > luminance(far) + 80
        # Unknown depth is the hatching's grey, no colour of the scale.
        red, _, blue, _ = tab.evaluate(pixel("depth", 0.2, 0.2))
        assert abs(red - blue) < 20
    kite.die()


def test_a_picture_that_cannot_be_decoded_is_left_out(running: RunningStation, tab: Tab) -> None:
    rook = Vehicle(running.vehicles, "rook")

    def speak() -> None:
        rook.say(4.0, shade=77)
        for topic, picture, header in (
            (keys.CAMERA, jpeg(200), camera_header().encode()),
            (keys.DEPTH, depth_png(1.0), depth_header().encode()),
        ):
            running.vehicles.put(
                keys.key("rook", topic),
                picture[:-30] + b"\xff" * 9 if topic == keys.DEPTH else picture[:170],
                attachment=header,
            )

    with Talk(speak):
        tab.open(f"{running.url}/#vehicle=rook")
        tab.wait_for(f"{COUNT.format('camera')} > 2 && {COUNT.format('depth')} > 2")
        tab.wait_for(is_text("#nearest", "4.0 m"))
        assert tab.evaluate(pixel("camera", 0.5, 0.5))[0] < 120
    rook.die()
    tab.errors.clear()  # the page tells its console of pictures that are none


def test_obstacle_clear_and_unknown_are_told_apart(running: RunningStation, tab: Tab) -> None:
    side = {"name": "left", "used": False, "camera": "lost", "frames_per_s": 0.0}
    side["trouble"] = "no pictures from the camera"
    crow = Vehicle(running.vehicles, "crow", {"extra_cameras": [side]})
    say: list[dict[str, object]] = [{"distance_m": 3.46}]
    with Talk(lambda: crow.say(**say[0])):  # type: ignore[arg-type]
        tab.open(f"{running.url}/#vehicle=crow")
        tab.wait_for(is_text("#nearest", "3.4 m"))  # rounded down, never up
        assert tab.text("#nearest-words") == "straight ahead"
        tab.wait_for(is_text("#facts", "2.1 m/s"))
        for words in ("GUIDED", "±5 %", "61 ms", "kB/s", "3.4 m", "14.6 /s"):
            assert words in tab.text("#facts")
        assert tab.text("#recording").strip() == "REC"
        assert "left OFF" in tab.text("#facts")
        assert tab.text("#trouble") == "camera left OFF: no pictures from the camera"
        say[0] = {"distance_m": None}
        tab.wait_for(is_text("#nearest", "> 20"))
        assert "where it sees (85° of 360°)" in tab.text("#nearest-words")
        say[0] = {"distance_m": None, "trouble": "no height above ground"}
        tab.wait_for(is_text("#nearest", "unknown"))
        assert tab.text("#nearest-words") == "no height above ground"
        assert "no distances: no height above ground" in tab.text("#trouble")
        tab.wait_for(is_text("#live", "unknown"))  # a screen reader is told
    crow.die()


def test_a_killed_vehicle_turns_stale_and_then_no_data(running: RunningStation, tab: Tab) -> None:
    wren = Vehicle(running.vehicles, "wren")
    state = "document.getElementById('vehicle').dataset.freshness"
    row = "document.querySelector('li[data-name=wren]')?.dataset.freshness"
    talk = Talk(wren.say)
    with talk:
        tab.open(f"{running.url}/#vehicle=wren")
        tab.wait_for(f"{state} === 'live' && {row} === 'live' && {COUNT.format('camera')} > 0")
        talk.stop()
        tab.wait_for(f"{state} === 'stale' && {row} === 'stale'")
        assert "STALE" in tab.text("#nearest-words")
        tab.wait_for(f"{state} === 'none' && {row} === 'none'")
        assert tab.text("#nearest") == "no data"
        assert tab.text("li[data-name=wren] .distance") == "\N{EN DASH}"
        tab.wait_for(is_text("#alarm", "no data"))
        # No frozen picture stays.
        tab.wait_for("document.getElementById('camera-figure').dataset.freshness === 'none'")
        hidden = "getComputedStyle(document.getElementById('camera')).visibility"
        assert tab.evaluate(hidden) == "hidden"
    wren.die()
    tab.wait_for(is_text("li[data-name=wren] .fresh", "session gone"))


def test_twenty_vehicles_are_listed_and_the_keyboard_goes_through_them(
    running: RunningStation, tab: Tab
) -> None:
    fleet = [Vehicle(running.vehicles, f"v{number:02}") for number in range(20)]

    def speak() -> None:
        for vehicle in fleet:
            vehicle.say(5.0 + vehicle.spoken % 3)

    with Talk(speak, 0.3):
        tab.open(f"{running.url}/#vehicle=v00")
        tab.wait_for("document.querySelectorAll('#vehicles li[data-name^=v]').length === 20")
        tab.wait_for(
            "document.querySelectorAll('#vehicles li[data-name^=v][data-freshness=live]').length > 0"
        )
        tab.evaluate("document.getElementById('vehicles').focus()")
        tab.press("ArrowDown")
        tab.wait_for(is_text("#name", "v01"))
        tab.press("End")
        selected = "document.querySelector('li[aria-selected=true]')?.dataset.name"
        names = tab.evaluate("[...document.querySelectorAll('#vehicles li')].map(li => li.dataset.name)")
        tab.wait_for(f"{selected} === {json.dumps(names[-1])}")
        tab.press("ArrowUp")
        tab.wait_for(f"{selected} === {json.dumps(names[-2])}")
        active = "document.getElementById('vehicles').getAttribute('aria-activedescendant')"
        assert tab.evaluate(f"document.getElementById({active}).dataset.name") == names[-2]
        assert tab.evaluate("location.hash") == f"#vehicle={names[-2]}"
    for vehicle in fleet:
        vehicle.die()


def test_a_stalled_browser_holds_nobody_up(running: RunningStation, browser: Chromium, tab: Tab) -> None:
    lark = Vehicle(running.vehicles, "lark")
    shown = f"{COUNT.format('camera')}"
    with Talk(lark.say), browser.tab() as stalled:
        for page in (stalled, tab):
            page.open(f"{running.url}/#vehicle=lark")
            page.wait_for(f"{shown} > 0")
        stalled.call("Debugger.enable")
        stalled.call("Debugger.pause")  # its JavaScript stands still from here on
        stalled.wait_event("Debugger.paused")
        before = int(tab.evaluate(shown))
        tab.wait_for(f"{shown} > {before + 10}")
        stalled.call("Debugger.resume")
        stalled.wait_for("document.getElementById('vehicle').dataset.freshness === 'live'")
    lark.die()


def test_a_phone_shows_everything_without_scrolling_sideways(running: RunningStation, tab: Tab) -> None:
    tern = Vehicle(running.vehicles, "tern")
    with Talk(tern.say):
        tab.open(f"{running.url}/#vehicle=tern", 390, 844, theme="dark")
        tab.wait_for(is_text("#nearest", "6.0 m"))
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390
        assert tab.evaluate("document.documentElement.dataset.theme") == "dark"
        size = "parseFloat(getComputedStyle(document.getElementById('nearest')).fontSize)"
        assert tab.evaluate(size) >= 80
    tern.die()


def test_the_page_says_when_the_station_is_gone(tab: Tab) -> None:
    with station() as short_lived:
        tab.open(short_lived.url)
        tab.wait_for("document.getElementById('station').dataset.state === 'open'")
    tab.wait_for("document.getElementById('station').dataset.state === 'lost'")
    assert "not reached" in tab.text("#station")
    tab.errors.clear()  # the browser itself complains of the connection


def test_a_token_in_the_address_opens_the_page_and_leaves_the_address(browser: Chromium) -> None:
    with station(TOKEN) as guarded, browser.tab() as tab:
        jay = Vehicle(guarded.vehicles, "jay")
        with Talk(jay.say):
            tab.open(guarded.url)
            tab.wait_for("document.getElementById('login').open")
            tab.evaluate("document.getElementById('token').focus()")
            tab.call("Input.insertText", text=TOKEN)
            tab.press("Enter")
            tab.wait_for(is_text("#nearest", "6.0 m"))
            tab.call("Network.clearBrowserCookies")
            tab.open("about:blank")
            tab.open(f"{guarded.url}/#token={TOKEN}")
            tab.wait_for(is_text("#nearest", "6.0 m"))
            assert TOKEN not in tab.evaluate("location.href")


def test_nothing_is_loaded_from_elsewhere(running: RunningStation, tab: Tab) -> None:
    tab.open(running.url)
    tab.wait_for("document.getElementById('station').dataset.state === 'open'")
    names = tab.evaluate("performance.getEntriesByType('resource').map(entry => entry.name)")
    assert names
    assert all(name.startswith(running.url) for name in names)
    # Nor can text from the network ever become code or markup.
    inject = "document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=\"globalThis.ran = true\">')"
    tab.evaluate(f"try {{ {inject} }} catch (error) {{ globalThis.refused = error.name }}")
    assert tab.evaluate("globalThis.refused") == "TypeError"
    tab.errors.clear()
