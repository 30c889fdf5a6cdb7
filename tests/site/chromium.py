"""Headless Chromium, controlled through its DevTools pipe, so that only the browser itself must be installed.

The protocol is https://chromedevtools.github.io/devtools-protocol/; messages are JSON, each ended by a zero byte.
"""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from urllib.parse import unquote, urlsplit

TIMEOUT_S = 60


class Page:
    """One page in one browser, at one size and in one colour scheme."""

    def __init__(self, *, width: int, height: int, dark: bool):
        self._profile = tempfile.mkdtemp(prefix="mateval-chromium-")
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        words = ["chromium", "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu",
                 "--hide-scrollbars", "--no-first-run", "--disable-dev-shm-usage", f"--user-data-dir={self._profile}",
                 # WebGL without a graphics card.
                 "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        # The browser reads from descriptor 3 and writes to 4. Some shells support only descriptors under 10, which do
        # not suffice for two pages at once.
        self._process = subprocess.Popen(
            ["sh", "-c", f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}', *words, "about:blank"],
            pass_fds=(to_browser, from_browser), stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self._buffer = b""
        self._number = 0
        self._session = None
        #: Errors that pages wrote to their console, and files that could not be loaded.
        self.faults: list[str] = []
        #: Files that the page and its parts were read from.
        self.files: list[str] = []
        self._loaded = False
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.send(f"{domain}.enable")
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        scheme = "dark" if dark else "light"
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def close(self) -> None:
        self._process.terminate()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)
        shutil.rmtree(self._profile, ignore_errors=True)

    def send(self, method: str, **params: object) -> dict:
        """Sends a command and returns its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        number = self._number
        while True:
            answer = self._next()
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _next(self) -> dict:
        end = time.monotonic() + TIMEOUT_S
        while b"\0" not in self._buffer:
            if not select.select([self._read], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError("the browser does not answer")
            piece = os.read(self._read, 1 << 20)
            if not piece:
                raise RuntimeError("the browser has ended")
            self._buffer += piece
        message, self._buffer = self._buffer.split(b"\0", 1)
        event = json.loads(message)
        self._heed(event)
        return event

    def _heed(self, event: dict) -> None:
        params = event.get("params", {})
        if event.get("method") == "Page.loadEventFired":
            self._loaded = True
        elif event.get("method") == "Runtime.exceptionThrown":
            self.faults.append(params["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        elif event.get("method") == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.faults.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")
        elif event.get("method") == "Network.requestWillBeSent":
            url = params["request"]["url"]
            if url.startswith("file:"):
                self.files.append(unquote(urlsplit(url).path))
            if not url.startswith(("file:", "data:", "about:")):
                self.faults.append(f"asked for {url}")

    def open(self, url: str) -> float:
        """Opens a page and returns the seconds until it was loaded."""
        self._loaded = False
        start = time.monotonic()
        # Opens a blank page first, because an address that differs only after the # would load nothing.
        self.send("Page.navigate", url="about:blank")
        self._wait_for_load()
        self._loaded = False
        self.files.clear()
        start = time.monotonic()
        self.send("Page.navigate", url=url)
        self._wait_for_load()
        return time.monotonic() - start

    def _wait_for_load(self) -> None:
        while not self._loaded:
            self._next()

    def run(self, script: str) -> object:
        """Returns the value of a script, after waiting for promises."""
        answer = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait_for(self, condition: str) -> None:
        """Waits until a script is true."""
        end = time.monotonic() + TIMEOUT_S
        while not self.run(f"Boolean({condition})"):
            if time.monotonic() > end:
                raise TimeoutError(f"never true: {condition}")
            time.sleep(0.05)

    def key(self, key: str) -> None:
        """Presses and releases a key."""
        code = {"ArrowRight": 39, "ArrowLeft": 37, "ArrowUp": 38, "Tab": 9, "Enter": 13, " ": 32}[key]
        text = {"Enter": "\r", " ": " "}.get(key)
        down = {"type": "keyDown" if text else "rawKeyDown", "key": key, "windowsVirtualKeyCode": code}
        self.send("Input.dispatchKeyEvent", **down, **({"text": text} if text else {}))
        self.send("Input.dispatchKeyEvent", type="keyUp", key=key, windowsVirtualKeyCode=code)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Moves the mouse with its button pressed."""
        for kind, (x, y) in [("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)]:
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def picture(self, path: str, *, whole: bool = False) -> None:
        """Writes a screenshot of the visible part, or of the whole page."""
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        with open(path, "wb") as file:
            file.write(base64.b64decode(data))
