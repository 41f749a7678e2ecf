# SPDX-License-Identifier: Apache-2.0
"""Shared by the tests of `activestereo view`: a served path, and a browser on its page."""

import re
import threading

from activestereo.cli import make_parser
from activestereo.cli.view import make_server
from chromium import Page


class View:
    """A served path and a browser's page on it."""

    def __init__(self, *arguments, shown="refined"):
        args = make_parser().parse_args(["view", "--device", "cpu", *map(str, arguments)])
        self.server = make_server(args, args.path)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.page = Page(self.server.address, (1280, 900))
        self.wait(shown)

    def wait(self, shown="refined"):
        state = "document.getElementById('view').dataset.shown"
        self.page.wait(f"['{shown}', 'nothing'].includes({state})")
        assert self.page.value(state) == shown, self.page.text("#told")

    def point(self, u, v):
        """The pointer on the middle of a pixel of the measured picture, which is shown whole."""
        width, height = self.page.value("[facts.width, facts.height]")
        self.page.point("#measured", (u + 0.5) / width, (v + 0.5) / height)

    def numbers(self):
        """Those of the readout, in its order: u, v, and of each quantity measured and simulated."""
        return [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?", self.page.text("#readout").replace("none", "0"))]

    def key(self, key, **more):
        self.page.call("Input.dispatchKeyEvent", type="keyDown", key=key, **more)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.page.__exit__()
        self.server.shutdown()
        self.server.server_close()
