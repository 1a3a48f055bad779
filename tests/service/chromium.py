"""Debian's headless Chromium, driven over its DevTools protocol."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest
from websockets.sync.client import ClientConnection, connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this computer (Debian: apt install chromium)"
)

_START_S = 60.0
_WAIT_S = 60.0
"""A browser on a busy machine is slow: only a test that has failed waits so long."""

_ANSWER_S = 60.0


def wait_until(holds: Callable[[], bool]) -> None:
    """Return as soon as `holds`; the test fails if it never does."""
    end = time.monotonic() + _WAIT_S
    pause = threading.Event()
    while not holds():
        if time.monotonic() > end:
            raise AssertionError(f"still not so after {_WAIT_S} s")
        pause.wait(0.02)


class Tab:
    """One page. `evaluate` runs JavaScript in it and gives back the value."""

    def __init__(self, socket_url: str, *, is_page: bool = True) -> None:
        self._connection = connect(socket_url, max_size=None, open_timeout=_START_S)
        self._socket: ClientConnection = self._connection.__enter__()
        self._number = 0
        self._events: set[str] = set()
        self.errors: list[str] = []
        for domain in ("Page", "Runtime", "Log", "Network") if is_page else ():
            self.call(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._connection.__exit__(kind, error, traceback)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its answer. Complaints of the page are kept meanwhile."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(_ANSWER_S))
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']['message']}")
                answer: dict[str, Any] = message["result"]
                return answer
            self._note(message)

    def wait_event(self, method: str) -> None:
        """Return when the browser has told of that event."""
        while method not in self._events:
            self._note(json.loads(self._socket.recv(_ANSWER_S)))

    def open(self, url: str, width: int = 1366, height: int = 768, *, theme: str = "light") -> None:
        """Load a page in a window of that size; phones are narrow and have sharp screens."""
        is_phone = width < 600
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if is_phone else 1,
            mobile=is_phone,
        )
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
        self.call("Page.navigate", url=url)
        # A page is there when it has left the one before: until then everything is asked of that one.
        self.wait_for(
            f"document.readyState === 'complete' && location.href.startsWith({json.dumps(url.split('#')[0])})"
        )

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression; of a promise, what it resolves to."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def text(self, selector: str) -> str:
        """Text of the first element, empty if there is none."""
        return str(self.evaluate(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''"))

    def wait_for(self, expression: str) -> None:
        """Return as soon as the expression is true."""
        wait_until(lambda: bool(self.evaluate(expression)))

    def press(self, key: str) -> None:
        """A key of the keyboard, where the focus is."""
        codes = {"ArrowDown": 40, "ArrowUp": 38, "End": 35, "Home": 36, "Tab": 9, "Enter": 13}
        for kind in ("keyDown", "keyUp"):
            text = {"text": "\r"} if (key, kind) == ("Enter", "keyDown") else {}
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key,
                windowsVirtualKeyCode=codes[key],
                **text,
            )

    def screenshot(self, path: Path, *, whole: bool = False) -> None:
        """What the window shows, or the whole page, as PNG."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))

    def _note(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        self._events.add(message.get("method", ""))
        if message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"])[:500])
        elif message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(json.dumps(parameters["args"])[:500])
        elif message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])


class Chromium:
    """A running browser."""

    def __init__(self, port: int) -> None:
        self._port = port

    @contextmanager
    def tab(self) -> Iterator[Tab]:
        """A new empty page in a window of its own: pages behind others count as hidden."""
        with urllib.request.urlopen(
            f"http://127.0.0.1:{self._port}/json/version", timeout=_ANSWER_S
        ) as answer:
            browser_url = json.load(answer)["webSocketDebuggerUrl"]
        with Tab(browser_url, is_page=False) as browser:
            target = browser.call("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
            with Tab(f"ws://127.0.0.1:{self._port}/devtools/page/{target}") as tab:
                yield tab
            browser.call("Target.closeTarget", targetId=target)


@contextmanager
def chromium() -> Iterator[Chromium]:
    """Headless Chromium with a profile of its own."""
    assert CHROMIUM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [
                CHROMIUM,
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-extensions",
                "--no-first-run",
                "--mute-audio",
                "--remote-debugging-port=0",
                "--remote-allow-origins=*",
                f"--user-data-dir={profile}",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            port_file = Path(profile) / "DevToolsActivePort"
            wait_until(lambda: port_file.is_file() and port_file.read_text().count("\n") >= 1)
            yield Chromium(int(port_file.read_text().split()[0]))
        finally:
            process.terminate()
            process.wait(30)
