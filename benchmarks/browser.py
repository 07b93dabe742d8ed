"""A headless browser for tests, benchmarks and screenshots: Chromium over its DevTools protocol."""

import base64
import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import connect
from websockets.sync.connection import Connection

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--remote-debugging-port=0",
    # It would keep pages that were left, with their connections, until it has too many of them.
    "--disable-features=BackForwardCache",
)  # fmt: skip
START = 240.0
"""Time limit for the browser to start, and for each answer; a busy computer draws the first picture for
minutes [s]."""
_EVENTS = (
    "Runtime.exceptionThrown",
    "Runtime.consoleAPICalled",
    "Log.entryAdded",
    "Network.requestWillBeSent",
)


class BrowserError(RuntimeError):
    """There is no browser, or it does not do what it is asked."""


def find_browser() -> str:
    """Path of a browser.

    Raises:
        BrowserError: None is installed.
    """
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        raise BrowserError(f"no browser: none of {', '.join(BROWSERS)} is installed")
    return found


class Page:
    """A page in a browser."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._count = 0
        self.events: list[dict[str, Any]] = []
        """What the page has reported: console, log, requests."""
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the DevTools protocol.

        Raises:
            BrowserError: The browser refuses.
        """
        self._count += 1
        self._connection.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._connection.recv(timeout=START))
            if message.get("method") in _EVENTS:
                self.events.append(message)
            if message.get("id") == self._count:
                if "error" in message:
                    raise BrowserError(f"{method}: {message['error']}")
                return message["result"]

    def evaluate(self, code: str) -> Any:
        """The value of a JavaScript expression.

        Raises:
            BrowserError: It raises an exception.
        """
        answer = self.call("Runtime.evaluate", expression=code, returnByValue=True)
        if "exceptionDetails" in answer:
            raise BrowserError(f"{code}: {answer['exceptionDetails']['text']}: {answer['result']}")
        return answer["result"].get("value")

    def text(self) -> str:
        """The text that the page shows; none while it is loaded."""
        return str(self.evaluate("document.body?.innerText ?? ''"))

    def wait_for(self, text: str, timeout: float = START) -> None:
        """Wait until the page shows a text.

        Raises:
            BrowserError: It does not.
        """
        end = time.monotonic() + timeout
        while text not in self.text():
            if time.monotonic() > end:
                raise BrowserError(f"no {text!r} in {self.text()!r}")
            time.sleep(0.2)

    def press(self, label: str) -> None:
        """Click the button with this label."""
        code = f"[...document.querySelectorAll('button')].find(b => b.innerText.trim() === {label!r}).click()"
        self.evaluate(code)

    def expand(self, folder: str) -> None:
        """Open the folder of controls with this name, or close it."""
        names = f"[...document.querySelectorAll('*')].filter(e => e.innerText?.trim() === {folder!r})"
        self.evaluate(f"{names}.at(-1).click()")

    def click(self, label: str) -> None:
        """Click the checkbox, or open the list, with this label."""
        self.evaluate(f"{_control(label)}.click()")

    def choose(self, label: str, option: str) -> None:
        """Choose an option of the list with this label."""
        self.click(label)
        found = (
            f"[...document.querySelectorAll('[role=option]')].find(o => o.innerText.trim() === {option!r})"
        )
        end = time.monotonic() + START
        while not self.evaluate(f"!!{found}"):
            if time.monotonic() > end:
                raise BrowserError(f"no {option!r} in {label!r}")
            time.sleep(0.1)
        self.evaluate(f"{found}.click()")

    def enter(self, label: str, number: int, text: str) -> None:
        """Write into one of the numbers with this label, counted from 0.

        Raises:
            BrowserError: It does not take the text.
        """
        field = f"{_control(label)}.closest('.mantine-NumberInput-root').parentElement"
        field = f"{field}.querySelectorAll('input')[{number}]"
        end = time.monotonic() + START
        while True:
            self.evaluate(f"{field}.focus(), {field}.select()")
            self.call("Input.insertText", text=text)
            # A page that is still being drawn may take the focus away in between.
            if self.evaluate(f"{field}.value") == text:
                return
            if time.monotonic() > end:
                raise BrowserError(f"{label}: expected it to take {text!r}")
            time.sleep(0.1)

    def key(self, name: str) -> None:
        """Press a key, such as Home, in what has the focus."""
        codes = {"Home": 36, "End": 35, "ArrowRight": 39, "ArrowUp": 38, "-": 189}
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=codes[name]
            )

    def imitate(self, width: int, height: int, dark: bool) -> None:
        """Behave as a page of this size [px] in a system whose colours are dark or light."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def screenshot(self) -> np.ndarray:
        """The page as an image, shape (rows, columns, 3), 0 to 255."""
        import imageio.v3 as iio

        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(iio.imread(io.BytesIO(data)))[..., :3]

    def errors(self) -> list[str]:
        """Exceptions and errors that the page has reported so far."""
        self.evaluate("0")
        return [json.dumps(event)[:500] for event in self.events if _is_error(event)]

    def hosts(self) -> set[str]:
        """Addresses that were asked for anything over a network."""
        urls = [e["params"]["request"]["url"] for e in self.events if e["method"].startswith("Network")]
        return {url.split("/")[2] for url in urls if not url.startswith(("data:", "blob:"))}


def _control(label: str) -> str:
    """JavaScript expression of the control with a label."""
    found = f"[...document.querySelectorAll('label')].find(l => l.innerText.trim() === {label!r})"
    return f"document.getElementById({found}.htmlFor)"


def _is_error(event: dict[str, Any]) -> bool:
    parameters = event["params"]
    if event["method"] == "Runtime.consoleAPICalled":
        return bool(parameters["type"] in ("error", "assert"))
    if event["method"] == "Log.entryAdded":
        return bool(parameters["entry"]["level"] == "error")
    return bool(event["method"] == "Runtime.exceptionThrown")


@contextlib.contextmanager
def browser_page(
    url: str, profile: Path, size: tuple[int, int] = (900, 640)
) -> Iterator[tuple[Page, subprocess.Popen[bytes]]]:
    """Open a page; yields it and the browser's process, which leads a process group.

    Args:
        url: Address of the page.
        profile: Folder for the browser's files.
        size: Width and height of the window; the browser keeps a part of the height.

    Raises:
        BrowserError: No browser is installed, or it does not start.
    """
    window = f"--window-size={size[0]},{size[1]}"
    process = subprocess.Popen(
        [find_browser(), *OPTIONS, window, f"--user-data-dir={profile}", "about:blank"],
        stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        port = _port(profile / "DevToolsActivePort")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=START) as answer:
            target = next(each for each in json.load(answer) if each["type"] == "page")
        address = target["webSocketDebuggerUrl"]
        # Pings would end it where a page reports much while nobody calls it: their answers wait behind that.
        with connect(address, max_size=None, compression=None, ping_interval=None) as connection:
            page = Page(connection)
            page.call("Page.navigate", url=url)
            yield page, process
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _port(file: Path) -> int:
    end = time.monotonic() + START
    while time.monotonic() < end:
        with contextlib.suppress(OSError, IndexError, ValueError):
            return int(file.read_text().split()[0])
        time.sleep(0.05)
    raise BrowserError("the browser did not start")
