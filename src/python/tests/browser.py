"""A headless Chromium, led over pipes by the DevTools protocol."""

import base64
import json
import os
import select
import subprocess
import time
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 800, 600
PATIENCE = 60  # seconds for any answer


class Browser:
    def __init__(self, program, folder):
        self.folder = Path(folder)
        to_read, self.to = os.pipe()
        self.back, to_write = os.pipe()
        # The protocol wants the file descriptors 3 and 4; software draws, the network is cut off.
        words = [
            program,
            "--headless=new",
            "--no-sandbox",
            "--disable-dev-shm-usage",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--remote-debugging-pipe",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            "--disable-background-networking",
            "--no-first-run",
            "--hide-scrollbars",
            f"--user-data-dir={self.folder / 'profile'}",
        ]
        homes = dict.fromkeys(("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"), str(self.folder))
        self.log = open(self.folder / "log", "wb")
        self.process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{to_read} 4>&{to_write}', "bash", *words],
            pass_fds=(to_read, to_write),
            env={**os.environ, **homes},
            stdin=subprocess.DEVNULL,
            stdout=self.log,
            stderr=self.log,
        )
        os.close(to_read)
        os.close(to_write)
        self.rest, self.number, self.session = b"", 0, None
        self.complaints, self.requests, self.frames = [], [], ""
        self.picture = self.folder / "picture.png"
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(domain + ".enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=WIDTH,
            height=HEIGHT,
            deviceScaleFactor=1,
            mobile=False,
        )

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.kill()
        self.process.wait()
        self.log.close()
        os.close(self.to)
        os.close(self.back)

    # ---- protocol -----------------------------------------------------------------------------

    def call(self, method, **params):
        """Send one message, gather events until its answer comes."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                assert "error" not in answer, (method, answer)
                return answer["result"]
            self.note(answer)

    def receive(self):
        end = time.monotonic() + PATIENCE
        while b"\0" not in self.rest:
            ready, _, _ = select.select([self.back], [], [], max(0, end - time.monotonic()))
            piece = os.read(self.back, 1 << 20) if ready else b""
            if not piece:
                raise RuntimeError(
                    "Chromium does not answer:\n"
                    + (self.folder / "log").read_text(errors="replace")[-3000:]
                )
            self.rest += piece
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def note(self, event):
        """Keep what the page complains of, and what it asks the network for."""
        params = event.get("params", {})
        method = event.get("method")
        if method == "Runtime.consoleAPICalled" and params["type"] in (
            "error",
            "warning",
            "assert",
        ):
            self.complaints.append(params["args"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(params["exceptionDetails"])
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            # Reading pixels back for a screenshot, the browser blames itself for slowness.
            if "GPU stall due to ReadPixels" not in params["entry"]["text"]:
                self.complaints.append(params["entry"])
        elif method == "Network.requestWillBeSent":
            if not params["request"]["url"].startswith("data:"):
                self.requests.append(params["request"]["url"])

    def value(self, expression):
        return self.call("Runtime.evaluate", expression=expression)["result"].get("value")

    def drawn(self, do):
        """Do something and wait until the page has drawn once more."""
        before = int(self.value(self.frames) or 0)
        do()
        end = time.monotonic() + PATIENCE
        while int(self.value(self.frames) or 0) <= before:
            late = time.monotonic() > end
            assert not late and not self.complaints, f"the page does not draw: {self.complaints}"
            time.sleep(0.02)

    # ---- a person -----------------------------------------------------------------------------

    def open(self, path, frame=False):
        """Show a page; frame: what draws is inside its first frame."""
        self.call("Page.navigate", url="about:blank")
        self.complaints, self.requests = [], []
        inside = "document.querySelector('iframe')?.contentDocument" if frame else "document"
        self.frames = f"{inside}?.documentElement.dataset.frames"
        self.drawn(lambda: self.call("Page.navigate", url=path.as_uri()))

    def screenshot(self):
        """(height, width, 3) pixels, once two in succession are the same."""
        from PIL import Image

        last = b""
        for _ in range(50):
            data = base64.b64decode(self.call("Page.captureScreenshot")["data"])
            if data == last:
                break
            last = data
        self.picture.write_bytes(last)
        return np.asarray(Image.open(self.picture).convert("RGB")).astype(int)

    def mouse(self, kind, at, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], **more)

    def press(self, at, count=1):
        self.mouse("mousePressed", at, button="left", buttons=1, clickCount=count)

    def release(self, at, count=1):
        self.mouse("mouseReleased", at, button="left", clickCount=count)

    def drag(self, start, end, shift=False):
        self.press(start)
        self.drawn(lambda: self.mouse("mouseMoved", end, button="left", buttons=1, modifiers=8 * shift))
        self.release(end)

    def right_click(self, at):
        self.mouse("mousePressed", at, button="right", buttons=2, clickCount=1)
        self.mouse("mouseReleased", at, button="right", clickCount=1)

    def wheel(self, at, delta):
        self.drawn(lambda: self.mouse("mouseWheel", at, deltaX=0, deltaY=delta))

    def double_click(self, at):
        self.press(at)
        self.release(at)
        self.press(at, 2)
        self.drawn(lambda: self.release(at, 2))

    def key(self, name):
        self.value("document.getElementById('view').focus()")
        self.drawn(lambda: self.press_key(name))

    def press_key(self, name):
        self.call("Input.dispatchKeyEvent", type="keyDown", key=name, code=name)

    def click(self, identity):
        self.drawn(lambda: self.value(f"document.getElementById('{identity}').click()"))

    def click_at(self, at):
        self.press(at)
        self.drawn(lambda: self.release(at))

    def choose(self, identity, value):
        self.change(identity, value, "change")

    def slide(self, identity, value):
        self.change(identity, value, "input")

    def change(self, identity, value, event):
        found = f"document.getElementById('{identity}')"
        self.drawn(
            lambda: self.value(f"{found}.value = {value!r}; {found}.dispatchEvent(new Event('{event}'))")
        )

    def fingers(self, steps):
        """Fingers go down at the places of the first step and on to those of the next ones."""
        points = [[{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(step)] for step in steps]
        self.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=points[0])
        for step in points[1:]:
            self.drawn(lambda: self.call("Input.dispatchTouchEvent", type="touchMove", touchPoints=step))
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
