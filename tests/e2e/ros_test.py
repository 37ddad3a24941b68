"""Tests voxeld-ros with a ROS master and a publisher of ROS itself. Paths are in VOXELD, VOXELCTL and VOXELD_ROS."""
import base64
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client
from pathlib import Path
from typing import Any

import numpy as np
import voxeld as voxel

from operate_test import DISPLAY, LONG, Daemon, free_port, run

ARROW, CUBE, SPHERE, CYLINDER, LINE_STRIP, LINE_LIST, CUBE_LIST, SPHERE_LIST, POINTS, TEXT, MESH, TRIANGLES = range(12)
ADD, DELETE, DELETEALL = 0, 2, 3
NAN = float("nan")


def xyz(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def rgba(r: float, g: float, b: float, a: float = 1) -> dict[str, float]:
    return {"r": r, "g": g, "b": b, "a": a}


def marker(ns: str, ident: int, kind: int = CUBE, at: tuple[float, float, float] = (0, 0, 0), size: float = 0.4,
           **fields: Any) -> dict[str, Any]:
    return {"header": {"frame_id": "map"}, "ns": ns, "id": ident, "type": kind, "action": ADD,
            "pose": {"position": xyz(*at), "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}},
            "scale": xyz(size, size, size), "color": rgba(1, 0, 0), **fields}


class Ros(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.socket = f"unix:{folder.name}/voxeld.sock"
        self.daemon = Daemon(f'[server]\nlisten = ["{self.socket}"]\nhttp = "off"\n{DISPLAY}')
        self.addCleanup(self.daemon.__exit__, None, None, None)
        self.port = free_port()
        self.master = f"http://127.0.0.1:{self.port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": self.master, "ROS_IP": "127.0.0.1", "ROS_HOME": folder.name,
                            "ROS_LOG_DIR": folder.name, "PYTHONUNBUFFERED": "1"}

    def end(self, process: "subprocess.Popen[str]") -> None:
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.communicate()

    def start_master(self) -> "subprocess.Popen[str]":
        process = subprocess.Popen(["rosmaster", "--core", "-p", str(self.port)], text=True, env=self.environment,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(self.end, process)
        deadline = time.monotonic() + LONG
        while True:
            try:
                with xmlrpc.client.ServerProxy(self.master) as proxy:
                    proxy.getPid("/test")
                return process
            except OSError:
                self.assertLess(time.monotonic(), deadline)

    def start_robot(self) -> "subprocess.Popen[str]":
        self.robot = subprocess.Popen([sys.executable, str(Path(__file__).resolve().with_name("ros_publisher.py"))],
                                      stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=self.environment)
        self.addCleanup(self.end, self.robot)
        return self.robot

    def follow(self, *options: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen([os.environ["VOXELD_ROS"], "--server", self.socket, "--json", *options], text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=self.environment)
        self.addCleanup(self.end, process)
        self.assertEqual(self.line(process), {"event": "ready", "source": self.master})
        return process

    def line(self, process: "subprocess.Popen[str]") -> dict[str, Any]:
        assert process.stdout is not None
        text = process.stdout.readline()
        self.assertTrue(text, "it ended")
        return dict(json.loads(text))

    def await_news(self, process: "subprocess.Popen[str]", text: str) -> None:
        while self.line(process) != {"event": "news", "text": text}:
            pass

    def tell(self, **said: Any) -> None:
        assert self.robot.stdin is not None and self.robot.stdout is not None
        self.robot.stdin.write(json.dumps(said) + "\n")
        self.robot.stdin.flush()
        self.assertEqual(json.loads(self.robot.stdout.readline()), {"done": said["topic"]})

    def publish(self, topic: str, *markers: dict[str, Any]) -> None:
        self.tell(topic=topic, type="MarkerArray", message={"markers": list(markers)})

    def await_ids(self, v: voxel.Connection, *ids: str) -> None:
        deadline = time.monotonic() + LONG
        while sorted(entity.key.id for entity in v.entities()) != sorted(ids):
            self.assertLess(time.monotonic(), deadline, [entity.key.id for entity in v.entities()])

    def shown(self, v: voxel.Connection) -> Any:
        """Returns what is shown, including everything that the daemon has received so far."""
        accepted = v.commit().wait(LONG).accepted
        assert accepted is not None
        return v.capture(at_least_snapshot=accepted.snapshot, timeout=LONG).rgb.copy()

    def last(self, process: "subprocess.Popen[str]", number: int = signal.SIGINT) -> dict[str, Any]:
        process.send_signal(number)
        out, words = process.communicate(timeout=LONG)
        self.assertEqual((process.returncode, words), (0, ""))
        return dict(json.loads(out.splitlines()[-1]))

    def test_what_is_published_is_shown_as_the_same_drawn_here(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow("--layer", "robot")
        corners = [xyz(-0.8, -0.8, -0.5), xyz(0.8, -0.8, -0.5), xyz(0, 0.8, -0.5)]
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            self.publish("/plan", marker("a", 1, CUBE, (-0.5, 0, 0)), marker("a", 2, SPHERE, (0.4, 0.2, 0), color=rgba(1, 1, 1)),
                         marker("b", 1, LINE_STRIP, size=0, points=corners, color=rgba(0, 1, 0)),
                         marker("b", 2, POINTS, size=0, points=[xyz(0.5, -0.5, 0.5), xyz(-0.5, 0.5, 0.5)],
                                colors=[rgba(0, 0, 1), rgba(0, 1, 1)]),
                         marker("b", 3, TRIANGLES, size=1, points=corners, color=rgba(1, 1, 0)))
            self.await_ids(v, "/plan a/1#0", "/plan a/2#0", "/plan b/1#0", "/plan b/2#0", "/plan b/3#0")
            self.assertEqual({entity.key.layer for entity in v.entities()}, {"robot"})
            theirs = self.shown(v)
            tally = self.last(process)
            self.await_ids(v)  # the entities belonged to the process
            positions = np.array([[p["x"], p["y"], p["z"]] for p in corners], np.float32)
            mine = v.layer("mine")
            mine.box("a1", size=0.4, center=(-0.5, 0, 0), color=(255, 0, 0))
            mine.sphere("a2", radius=0.2, center=(0.4, 0.2, 0), color="white")
            mine.lines("b1", positions, colors=(0, 255, 0), mode="strip")
            mine.points("b2", np.array([[0.5, -0.5, 0.5], [-0.5, 0.5, 0.5]], np.float32),
                        colors=np.array([[0, 0, 255], [0, 255, 255]], np.uint8))
            mine.mesh("b3", positions, np.array([[0, 1, 2]], np.uint32), colors=(255, 255, 0))
            ours = self.shown(v)
        np.testing.assert_array_equal(theirs, ours)
        self.assertEqual((tally["channels"], tally["updates"], tally["entities"], tally["malformed"], tally["messages"]), (1, 1, 5, 0, 1))

    def test_every_type_is_taken_and_lists_are_as_their_parts(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow()
        # Where a cube's faces are in the outermost voxels of the solid cube, so that triangles cover no other voxels.
        two = [xyz(-0.5, -0.5, 0), xyz(0.5, 0.5, 0.25)]
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            self.publish("/all", *[marker("t", kind, kind, size=0.3, text="A", mesh_resource="package://a.dae",
                                          points=[] if kind < LINE_STRIP else two + two[:1] if kind == TRIANGLES else two)
                                   for kind in range(12)])
            self.await_ids(v, *[f"/all t/{kind}#0" for kind in range(12) if kind != MESH], f"/all t/{SPHERE_LIST}#1")
            self.publish("/all", marker("", 0, action=DELETEALL), marker("l", 1, CUBE_LIST, size=0.3, points=two),
                         marker("l", 2, SPHERE_LIST, (0, 0, -0.4), size=0.2, points=two), marker("l", 3, POINTS, size=0.25, points=two[:1]))
            self.await_ids(v, "/all l/1#0", "/all l/2#0", "/all l/2#1", "/all l/3#0")
            lists = self.shown(v)
            self.publish("/all", marker("", 0, action=DELETEALL), marker("o", 1, CUBE, (-0.5, -0.5, 0), 0.3), marker("o", 2, CUBE, (0.5, 0.5, 0.25), 0.3),
                         marker("o", 3, SPHERE, (-0.5, -0.5, -0.4), 0.2), marker("o", 4, SPHERE, (0.5, 0.5, -0.15), 0.2))
            self.await_ids(v, "/all o/1#0", "/all o/2#0", "/all o/3#0", "/all o/4#0")
            v.layer("mine").points("p", np.array([[-0.5, -0.5, 0]], np.float32), width=0.25, unit="units", colors=(255, 0, 0))
            ones = self.shown(v)
        np.testing.assert_array_equal(lists, ones)
        tally = self.last(process, signal.SIGTERM)
        self.assertEqual(tally["left_out"], ["models"])
        self.assertEqual((tally["malformed"], tally["refused"]), (0, 0))

    def test_markers_are_moved_deleted_and_have_their_time(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow()
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            self.publish("/plan", marker("a", 1), marker("a", 2), marker("b", 1))
            self.tell(topic="/one", type="Marker", message=marker("a", 1))
            self.await_ids(v, "/one a/1#0", "/plan a/1#0", "/plan a/2#0", "/plan b/1#0")
            self.publish("/plan", marker("a", 1, action=DELETE), marker("a", 2, at=(0.5, 0, 0)), marker("nobody", 9, action=DELETE),
                         marker("c", 1, lifetime={"secs": 0, "nsecs": 50_000_000}))
            self.await_ids(v, "/one a/1#0", "/plan a/2#0", "/plan b/1#0")
            self.publish("/plan", marker("d", 1), marker("", 0, action=DELETEALL), marker("e", 1, at=(0.5, 0, 0)))
            self.await_ids(v, "/one a/1#0", "/plan e/1#0")
            self.tell(topic="/one", type="Marker", message=marker("", 0, action=DELETEALL))
            self.await_ids(v, "/plan e/1#0")
            theirs = self.shown(v)
            tally = self.last(process)
            v.layer("mine").box("e", size=0.4, center=(0.5, 0, 0), color=(255, 0, 0))
            np.testing.assert_array_equal(theirs, self.shown(v))
        self.assertEqual((tally["channels"], tally["messages"], tally["malformed"]), (2, 5, 0))
        self.assertEqual(tally["entities"], 3 + 1 + 2 + 1)

    def test_what_cannot_be_read_is_counted_and_the_rest_goes_on(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow("--topic", "bad", "--topic", "/words")
        with voxel.connect(self.socket, timeout=LONG) as v:
            self.tell(topic="/words", advertise="String")
            self.publish("/bad", marker("a", 1), marker("a", 2))
            self.await_ids(v, "/bad a/1#0", "/bad a/2#0")
            self.publish("/bad", marker("a", 1, at=(NAN, 0, 0)), marker("b", 1, LINE_LIST, points=[xyz(0, 0, 0)] * 3),
                         marker("b", 2, TRIANGLES, points=[xyz(0, 0, 0)] * 4), marker("b", 3, 12), marker("b", 4, action=1),
                         marker("b", 5, pose={"position": xyz(0, 0, 0), "orientation": {"x": 3, "y": 0, "z": 0, "w": 0}}),
                         marker("b", 6))
            self.await_ids(v, "/bad a/2#0", "/bad b/6#0")
            # All three are malformed: one promises a marker that is missing, one an impossible number, and one is empty.
            for data in (b"\x01\0\0\0", b"\xff\xff\xff\xff", b""):
                self.tell(topic="/bad", type="MarkerArray", bytes=base64.b64encode(data).decode())
            self.publish("/bad", marker("", 0, action=DELETEALL), marker("good", 1))
            self.await_ids(v, "/bad good/1#0")
        tally = self.last(process)
        self.assertEqual(tally["malformed"], 6 + 3)
        self.assertIn("a message of /bad: ", tally["malformed_last"])
        self.assertEqual(tally["passed_over"], ["/words (std_msgs/String)"])
        self.assertEqual(tally["messages"], 6)

    def test_what_comes_too_fast_is_joined_and_the_last_word_holds(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow()
        with voxel.connect(self.socket, timeout=LONG, autocommit=False) as v:
            for i in range(300):
                self.publish("/fast", marker("moves", 1, at=(i / 600, 0, 0)), marker("goes", i), marker("goes", i - 1, action=DELETE))
            self.publish("/fast", marker("moves", 1, at=(0.5, 0, 0)), marker("goes", 299, action=DELETE), marker("last", 1, SPHERE, size=0.3))
            self.await_ids(v, "/fast last/1#0", "/fast moves/1#0")
            theirs = self.shown(v)
            tally = self.last(process)
            v.layer("mine").box("a", size=0.4, center=(0.5, 0, 0), color=(255, 0, 0))
            v.layer("mine").sphere("b", radius=0.15, color=(255, 0, 0))
            np.testing.assert_array_equal(theirs, self.shown(v))
        self.assertEqual((tally["messages"], tally["malformed"]), (301, 0))
        self.assertEqual(tally["updates"] + tally["joined"], 301)

    def test_masters_that_are_away_and_come_and_are_others(self) -> None:
        process = self.follow()
        self.await_news(process, f"waits for the ROS master at {self.master}")
        master = self.start_master()
        self.await_news(process, f"the ROS master at {self.master} is there")
        with voxel.connect(self.socket, timeout=LONG) as v:
            self.start_robot()
            self.publish("/plan", marker("a", 1))
            self.await_news(process, "follows /plan (visualization_msgs/MarkerArray)")
            self.await_ids(v, "/plan a/1#0")
            self.end(self.robot)
            self.end(master)
            self.await_news(process, f"waits for the ROS master at {self.master}")
            master = self.start_master()
            self.start_robot()
            self.publish("/plan", marker("a", 2))
            self.await_ids(v, "/plan a/1#0", "/plan a/2#0")
            # A master that does not answer does not delay the exit.
            master.send_signal(signal.SIGSTOP)
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=LONG)
            self.assertEqual(process.returncode, 0)
            self.await_ids(v)

    def test_a_daemon_that_goes_is_the_end_and_so_is_the_masters_word(self) -> None:
        self.start_master()
        self.start_robot()
        process = self.follow()
        self.publish("/plan", marker("a", 1))
        self.await_news(process, "follows /plan (visualization_msgs/MarkerArray)")
        proxy: Any
        with xmlrpc.client.ServerProxy(self.master) as proxy:
            node = [nodes for topic, nodes in proxy.getSystemState("/test")[2][1] if topic == "/plan"][0][0]
            self.assertTrue(node.startswith("/voxeld"), node)
            address = proxy.lookupNode("/test", node)[2]
        with xmlrpc.client.ServerProxy(address) as proxy:
            proxy.shutdown("/test", "enough")
        process.communicate(timeout=LONG)
        self.assertEqual(process.returncode, 0)
        process = self.follow()
        self.daemon.kill()
        _, words = process.communicate(timeout=LONG)
        self.assertEqual(process.returncode, 1)
        self.assertTrue(words.startswith("voxeld-ros: "), words)
        nobody = run(os.environ["VOXELD_ROS"], "--server", self.socket, "--master", self.master)
        self.assertEqual(nobody.returncode, 1)
        self.assertIn("cannot reach voxeld", nobody.stderr)
        wrong = run(os.environ["VOXELD_ROS"], "--server", self.socket, "--master", "nowhere")
        self.assertEqual(wrong.returncode, 2)
        self.assertIn("nowhere is no address of a ROS master", wrong.stderr)
        name = run(os.environ["VOXELD_ROS"], "--server", self.socket, "--master", self.master, "--topic", "a b")
        self.assertEqual(name.returncode, 2)
        self.assertIn("[a b]", name.stderr)


if __name__ == "__main__":
    unittest.main()
