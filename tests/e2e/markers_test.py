"""Tests voxelctl markers with a server from Foxglove. Paths are in VOXELD, VOXELCTL and NODE_MODULES."""
import base64
import json
import os
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path
from typing import Any

import numpy as np
import voxeld as voxel

from operate_test import DISPLAY, LONG, Daemon, voxelctl

WHITE = {"r": 1, "g": 1, "b": 1, "a": 1}
RED = {"r": 1, "g": 0, "b": 0, "a": 1}


def pose(x: float = 0, y: float = 0, z: float = 0) -> dict[str, Any]:
    return {"position": {"x": x, "y": y, "z": z}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}


def cube(ident: str, x: float, color: dict[str, float] = RED) -> dict[str, Any]:
    return {"id": ident, "cubes": [{"pose": pose(x), "size": {"x": 0.4, "y": 0.4, "z": 0.4}, "color": color}]}


class Markers(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.socket = f"unix:{folder.name}/voxeld.sock"
        daemon = Daemon(f'[server]\nlisten = ["{self.socket}"]\nhttp = "off"\n{DISPLAY}')
        self.addCleanup(daemon.__exit__, None, None, None)
        here = Path(__file__).resolve()
        self.node = subprocess.Popen(
            ["node", str(here.with_name("foxglove_server.js")), str(here.parents[2] / "tools/recording/scene_update.proto")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "NODE_PATH": os.environ["NODE_MODULES"]})
        self.addCleanup(self.end, self.node)
        assert self.node.stdout is not None
        self.url = f"ws://127.0.0.1:{json.loads(self.node.stdout.readline())['port']}"

    def end(self, process: "subprocess.Popen[str]") -> None:
        process.kill()
        process.communicate()

    def follow(self, *options: str, channels: int = 2) -> "subprocess.Popen[str]":
        process = subprocess.Popen([os.environ["VOXELCTL"], "--server", self.socket, "--json", "markers", self.url, *options],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.end, process)
        assert process.stdout is not None and self.node.stdout is not None
        self.assertEqual(json.loads(process.stdout.readline())["event"], "ready")
        for _ in range(channels):
            self.assertIn("subscribed", self.node.stdout.readline())
        return process

    def send(self, topic: str, update: Any = None, data: bytes = b"") -> None:
        assert self.node.stdin is not None
        what = {"update": update} if update is not None else {"bytes": base64.b64encode(data).decode()}
        self.node.stdin.write(json.dumps({"topic": topic, **what}) + "\n")
        self.node.stdin.flush()

    def await_ids(self, v: voxel.Connection, *ids: str) -> None:
        deadline = time.monotonic() + LONG
        while sorted(entity.key.id for entity in v.entities()) != sorted(ids):
            self.assertLess(time.monotonic(), deadline, [entity.key.id for entity in v.entities()])

    def shown(self, v: voxel.Connection) -> Any:
        """Returns what is shown, including everything that the daemon has received so far."""
        accepted = v.commit().wait(LONG).accepted
        assert accepted is not None
        return v.capture(at_least_snapshot=accepted.snapshot, timeout=LONG).rgb.copy()

    def last(self, process: "subprocess.Popen[str]") -> dict[str, Any]:
        process.send_signal(signal.SIGINT)
        out, words = process.communicate(timeout=LONG)
        self.assertIn(process.returncode, (0, 130), words)
        return dict(json.loads(out.splitlines()[-1]))

    def test_what_is_sent_is_shown_as_the_same_drawn_here(self) -> None:
        process = self.follow()
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            self.send("/shapes", {"entities": [cube("a", -0.5), {"id": "b", "spheres": [
                {"pose": pose(0.4, 0.2, 0), "size": {"x": 0.5, "y": 0.5, "z": 0.5}, "color": WHITE}]}]})
            self.await_ids(v, "/shapes a#0", "/shapes b#0")
            theirs = self.shown(v)
            # One is moved, one is removed, and one is sent to /words with its time.
            self.send("/shapes", {"entities": [cube("a", 0.5)], "deletions": [{"type": 0, "id": "b"}]})
            self.send("/words", {"entities": [{**cube("a", 0.0), "timestamp": {"sec": 1700000000, "nsec": 5},
                                               "lifetime": {"sec": 0, "nsec": 0}, "frame_id": "map"}]})
            self.await_ids(v, "/shapes a#0", "/words a#0")
            self.send("/shapes", {"deletions": [{"type": 1}]})
            self.await_ids(v, "/words a#0")
            tally = self.last(process)
            self.await_ids(v)
            v.layer("mine").box("a", size=0.4, center=(-0.5, 0, 0), color=(255, 0, 0))
            v.layer("mine").sphere("b", radius=0.25, center=(0.4, 0.2, 0), color="white")
            ours = self.shown(v)
        np.testing.assert_array_equal(theirs, ours)
        self.assertEqual((tally["updates"], tally["entities"], tally["deletions"], tally["malformed"]), (4, 4, 2, 0))
        self.assertEqual(tally["passed_over"], ["/tf (foxglove.FrameTransform, protobuf)"])

    def test_what_cannot_be_read_is_counted_and_the_rest_goes_on(self) -> None:
        process = self.follow("--topic", "/words", "--layer", "robot", channels=1)
        with voxel.connect(self.socket, timeout=LONG) as v:
            self.send("/words", data=b"{")
            self.send("/words", {"entities": [{"id": 7.5, "cubes": "none"}]})
            self.send("/words", {"entities": [{"id": "m", "models": [{"url": "a.glb"}]}, cube("a", float("1e300"))]})
            self.send("/words", {"entities": [cube("good", 0)]})
            self.await_ids(v, "/words good#0")
            self.assertEqual([entity.key.layer for entity in v.entities()], ["robot"])
        tally = self.last(process)
        self.assertGreaterEqual(tally["malformed"], 2)
        self.assertEqual(tally["left_out"], ["models"])

    def test_no_server_another_server_and_one_that_goes(self) -> None:
        none = voxelctl("--server", self.socket, "markers", "ws://127.0.0.1:9")
        self.assertEqual(none.returncode, 1)
        self.assertIn("no Foxglove server at 127.0.0.1:9", none.stderr)
        wrong = voxelctl("--server", self.socket, "markers", "http://127.0.0.1:9")
        self.assertIn("is no address of a Foxglove server", wrong.stderr)
        process = self.follow()
        self.node.kill()
        _, words = process.communicate(timeout=LONG)
        self.assertEqual(process.returncode, 1)
        self.assertIn("the Foxglove server has gone", words)


if __name__ == "__main__":
    unittest.main()
