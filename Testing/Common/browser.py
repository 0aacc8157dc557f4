"""A page in headless Chromium, driven by the DevTools protocol over pipes. Needs no network."""

import base64
import itertools
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile

PROGRAM = shutil.which("chromium")
OPTIONS = """--headless=new --no-sandbox --disable-dev-shm-usage --no-first-run --hide-scrollbars
--remote-debugging-pipe --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"""


class Page:
    """Opens a file. `problems` has each exception and error of the page, and each request."""

    def __init__(self, path, width=1366, height=768, dark=False):
        self.problems, self._ids, self._data = [], itertools.count(1), b""
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        # The browser reads from descriptor 3 and writes to 4, which the pipes may have themselves.
        options = f"{' '.join(OPTIONS.split())} --user-data-dir={self._profile.name} about:blank"
        script = f"exec 8<&{to_browser} 9>&{from_browser}; exec {PROGRAM} {options} 3<&8 4>&9"
        self._process = subprocess.Popen(
            ["bash", "-c", script],
            pass_fds=(to_browser, from_browser),
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._session = None
        targets = self("Target.getTargets")["targetInfos"]
        (target,) = (t for t in targets if t["type"] == "page")
        attached = self("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self(f"{domain}.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self("Emulation.setDeviceMetricsOverride", **size)
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self("Emulation.setEmulatedMedia", features=scheme)
        self._loaded = False
        self("Page.navigate", url=pathlib.Path(path).resolve().as_uri())
        while not self._loaded:
            self._receive()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        os.close(self._write)
        os.close(self._read)
        self._profile.cleanup()

    def __call__(self, method, **parameters):
        number = next(self._ids)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def _receive(self):
        while b"\0" not in self._data:
            part = os.read(self._read, 1 << 20)
            if not part:
                raise RuntimeError("chromium ended")
            self._data += part
        text, _, self._data = self._data.partition(b"\0")
        message = json.loads(text)
        kind, event = message.get("method"), message.get("params", {})
        if kind == "Page.loadEventFired":
            self._loaded = True
        elif kind == "Runtime.exceptionThrown":
            details = event["exceptionDetails"]
            self.problems.append(details.get("exception", {}).get("description", details["text"]))
        elif kind == "Runtime.consoleAPICalled" and event["type"] in ("error", "assert"):
            self.problems.append(str(event["args"]))
        elif kind == "Log.entryAdded" and event["entry"]["level"] == "error":
            self.problems.append(event["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            url = event["request"]["url"]
            if not url.startswith(("data:", "file:")):
                self.problems.append("request: " + url)
        return message

    def value(self, expression):
        """The value of an expression of JavaScript."""
        options = {"returnByValue": True, "awaitPromise": True}
        answer = self("Runtime.evaluate", expression=expression, **options)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def click(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def key(self, key):
        """As "a" or "ArrowRight"."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self("Input.dispatchKeyEvent", type=kind, key=key, **text)

    def png(self, whole=False):
        answer = self("Page.captureScreenshot", captureBeyondViewport=whole)
        return base64.b64decode(answer["data"])
