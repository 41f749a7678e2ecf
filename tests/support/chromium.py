# SPDX-License-Identifier: Apache-2.0
"""Drives headless chromium over a pipe by the DevTools protocol (chromedevtools.github.io/devtools-protocol)."""

import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import pytest

_PROGRAM = "chromium"
_ANSWER_S = 60.0


def is_installed() -> bool:
    return shutil.which(_PROGRAM) is not None


needs_chromium = pytest.mark.skipif(not is_installed(), reason="no chromium: install Debian's package chromium")


class Page:
    """A page in a browser that the context manager ends; RuntimeError if browser or script fail. size: pixels."""

    def __init__(self, path: Path | str, size: tuple[int, int] = (1280, 1000)) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="chromium-")
        self._messages, self._rest = [], b""
        from_us, self._write = os.pipe()
        self._read, to_us = os.pipe()
        command = [
            _PROGRAM, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--hide-scrollbars", "--enable-unsafe-swiftshader",
            "--disable-extensions", "--disable-background-networking", "--disable-component-update",
            "--remote-debugging-pipe",
            f"--user-data-dir={self._profile.name}", f"--window-size={size[0]},{size[1]}", "about:blank",
        ]  # fmt: skip
        # The protocol reads from file descriptor 3 and writes to 4.
        shell = ["bash", "-c", f'exec "$@" 3<&{from_us} 4>&{to_us}', "chromium", *command]
        self._process = subprocess.Popen(
            shell,
            pass_fds=(from_us, to_us),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(from_us)
        os.close(to_us)
        self._count, self._session = 0, None
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False
        )
        self.events = []
        self.call("Page.navigate", url=path if isinstance(path, str) else path.resolve().as_uri())
        self.wait("document.readyState === 'complete'")

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._session = None
            self.call("Browser.close")
        except (RuntimeError, OSError):
            self._process.kill()
        self._process.wait(timeout=20)
        os.close(self._read)
        os.close(self._write)
        self._profile.cleanup()

    def call(self, method: str, **parameters: object) -> dict:
        """Sends one command of the protocol and returns its result."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next_message()
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            if hasattr(self, "events"):
                self.events.append(answer)

    def _next_message(self) -> dict:
        end = time.monotonic() + _ANSWER_S
        while b"\0" not in self._rest:
            ready = select.select([self._read], [], [], max(0.0, end - time.monotonic()))[0]
            chunk = os.read(self._read, 1 << 16) if ready else b""
            if not chunk:
                raise RuntimeError(
                    "chromium " + ("gave no answer" if not ready else f"ended with status {self._process.poll()}")
                )
            self._rest += chunk
        message, self._rest = self._rest.split(b"\0", 1)
        return json.loads(message)

    def value(self, expression: str) -> object:
        """Evaluates a script expression and returns its value, awaiting a promise."""
        result = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(
                f"{expression}: {result['exceptionDetails'].get('exception', {}).get('description', 'failed')}"
            )
        return result["result"].get("value")

    def wait(self, condition: str) -> None:
        """Waits until a script expression is true. Raises RuntimeError after a minute."""
        end = time.monotonic() + _ANSWER_S
        while not self.value(condition):
            if time.monotonic() > end:
                raise RuntimeError(f"it never happened that {condition}")
            time.sleep(0.02)

    def place(self, selector: str, x: float = 0.5, y: float = 0.5) -> tuple[float, float]:
        """Scrolls an element into view. Returns window coordinates at shares x, y of its width and height."""
        script = f"""(() => {{ const e = document.querySelector({json.dumps(selector)});
            e.scrollIntoView({{block: 'center'}});
            const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; }})()"""
        box = self.value(script)
        return box[0] + x * box[2], box[1] + y * box[3]

    def mouse(self, kind: str, place: tuple[float, float], **more: object) -> None:
        self.call("Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1], **more)

    def click(self, selector: str, x: float = 0.5, y: float = 0.5, count: int = 1) -> None:
        """Clicks the left button inside an element `count` times. x, y: place as shares of its width and height."""
        place = self.place(selector, x, y)
        self.mouse("mouseMoved", place)
        for number in range(1, count + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self.mouse(kind, place, button="left", clickCount=number)

    def drag(self, selector: str, right: float, down: float = 0.0) -> None:
        """Drags an element's middle by pixels of the window."""
        x, y = start = self.place(selector)
        end = x + right, y + down
        self.mouse("mousePressed", start, button="left", clickCount=1)
        self.mouse("mouseMoved", end, button="left", buttons=1)
        self.mouse("mouseReleased", end, button="left")

    def point(self, selector: str, x: float = 0.5, y: float = 0.5) -> None:
        self.mouse("mouseMoved", self.place(selector, x, y))

    def wheel(self, selector: str, delta: float, x: float = 0.5, y: float = 0.5) -> None:
        self.mouse("mouseWheel", self.place(selector, x, y), deltaX=0, deltaY=delta)

    def text(self, selector: str) -> str:
        return self.value(f"document.querySelector({json.dumps(selector)}).textContent")

    def requests(self) -> list[str]:
        """Returns the addresses that the page requested, without data URIs."""
        sent = [e["params"]["request"]["url"] for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return [address for address in sent if not address.startswith("data:")]

    def complaints(self) -> list[str]:
        """Returns the texts of scripts' exceptions and of errors on the console."""
        thrown = [
            e["params"]["exceptionDetails"]["text"] for e in self.events if e.get("method") == "Runtime.exceptionThrown"
        ]
        entries = [e["params"]["entry"] for e in self.events if e.get("method") == "Log.entryAdded"]
        return thrown + [entry["text"] for entry in entries if entry["level"] == "error"]
