"""Tests the client against the real daemon where a fake one does not suffice. The daemon's path is in VOXELD."""
import asyncio
import os
import random
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import unittest
from typing import Any, Optional

import numpy as np

import voxeld as voxel

LONG = 60.0

# One red pixel, as a PNG.
PICTURE = bytes.fromhex("89504e470d0a1a0a0000000d494844520000000100000001080200000090"
                        "7753de0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082")


class Daemon:
    def __init__(self, folder: str, *options: str) -> None:
        self.path = f"{folder}/voxeld.sock"
        self.server = f"unix:{self.path}"
        self._command = [os.environ["VOXELD"], "--listen", self.server, "--http", "off", "--log-level", "warn",
                         "--display", "stack=simulated,geometry=planar,size=24x24x24", *options]
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(self._command)
        with voxel.connect(self.server, timeout=LONG):
            pass  # it listens

    def kill(self) -> None:
        self._process.kill()
        self._process.wait(LONG)


class Relay:
    """A socket in front of the daemon's, whose connections can be closed. `late_s`: the delay with which data passes, as on a slow network."""

    def __init__(self, path: str, behind: str, late_s: float = 0) -> None:
        self._behind = behind
        self._late_s = late_s
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(path)
        self._listener.listen()
        self._lock = threading.Lock()
        self._ends: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = socket.socket(socket.AF_UNIX)
            try:
                far.connect(self._behind)
            except OSError:
                near.close()
                far.close()
                continue
            with self._lock:
                self._ends += [near, far]
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=self._copy, args=(a, b), daemon=True).start()

    def _copy(self, source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(1 << 16):
                time.sleep(self._late_s)
                sink.sendall(data)
        except OSError:
            pass

    def cut(self) -> None:
        with self._lock:
            for end in self._ends:
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
                end.close()
            self._ends = []

    def close(self) -> None:
        self._listener.close()
        self.cut()


class RealServer(unittest.TestCase):
    maxDiff = None

    def setUp(self) -> None:
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.daemon = Daemon(self.folder)
        self.addCleanup(self.daemon.kill)

    def connect(self, server: Optional[str] = None, **options: Any) -> voxel.Connection:
        v = voxel.connect(server or self.daemon.server, timeout=LONG, **options)
        self.addCleanup(v.close)
        return v

    def test_a_slow_network_keeps_nobody_away(self) -> None:
        path = f"{self.folder}/slow.sock"
        relay = Relay(path, self.daemon.path, late_s=0.3)
        self.addCleanup(relay.close)
        v = self.connect(f"unix:{path}")
        self.assertEqual([display.name for display in v.displays(timeout=LONG)], ["stack"])

    def ids(self, v: voxel.Connection) -> list[str]:
        return sorted(entity.key.id for entity in v.entities(timeout=LONG))

    def test_every_shape_is_accepted(self) -> None:
        v = self.connect()
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
        numbers = np.arange(3.0)
        with v.frame("all") as f:
            f.points("points", corners, colors=numbers, cmap="plasma_r")
            f.voxels("voxels", corners)
            f.lines("lines", corners, colors=numbers, cmap="tab10")
            f.mesh("mesh", corners, shell=2)
            f.box("box", shell=1)
            f.sphere("sphere")
            f.cylinder("cylinder")
            f.volume("cells", np.arange(8.0).reshape(2, 2, 2), cmap="turbo")
            f.curve("curve", corners, colors=numbers, cmap="viridis")
            f.arc("arc", sweep=2)
            f.ellipse("ellipse")
            f.helix("helix", turns=3)
            f.bezier_surface("patches", np.random.default_rng(1).uniform(-1, 1, (4, 4, 3)), shell=2)
            f.arrow("arrow")
            f.text("text", "A")
            f.grid("grid", np.ones((2, 2, 2), np.uint8))
            f.isosurface("isosurface", np.arange(8.0).reshape(2, 2, 2), 3.5)
            f.ellipsoid("ellipsoid")
            f.torus("torus")
            f.cone("cone")
            f.parallelepiped("parallelepiped", (0, 0, 0), np.eye(3))
            f.disc("disc", inner_radius=0.2)
            f.patch("patch", (0, 0, 0), np.eye(3)[:2])
            f.polygon("polygon", [corners])
            f.height_map("height map", np.arange(4.0).reshape(2, 2), colors=np.arange(4.0).reshape(2, 2), cmap="Spectral_r", shell=2)
            f.implicit("implicit", "x^2 + y^2 - z = 0 where x^2 + y^2 <= 1")
        self.assertEqual(f.wait(LONG).state, "accepted")
        self.assertEqual(v.issues, [])
        self.assertEqual(len(self.ids(v)), 26)

    def test_what_was_uploaded_is_named_and_drawn_alike(self) -> None:
        v = self.connect()
        field = np.random.default_rng(3).integers(0, 256, (6, 5, 4), np.uint8)
        told: list[tuple[int, int]] = []
        asset = v.upload(field, progress=lambda sent, size: told.append((sent, size)))
        self.assertEqual(told, [(120, 120)])
        again = v.upload(field, progress=lambda sent, size: self.fail("it is there"))
        self.assertEqual(again, asset)
        self.assertEqual(v.upload(field.astype(float)).size, 480, "other numbers are float32")

        pictures = []
        for samples in (field, asset):
            with v.frame("l") as f:
                f.grid("grid", samples)
            accepted = f.wait(LONG).accepted
            assert accepted is not None
            pictures.append(v.capture(at_least_snapshot=accepted.snapshot, timeout=LONG))
        self.assertTrue(np.array_equal(pictures[0].rgb, pictures[1].rgb))
        self.assertTrue(pictures[0].rgb.any())

        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
        picture = v.upload(PICTURE)
        with v.frame("m") as f:
            f.mesh("textured", corners, texture=picture, uv=corners[:, :2])
            f.height_map("map", np.zeros((2, 2)), texture=picture)
        self.assertEqual(f.wait(LONG).state, "accepted")
        self.assertEqual(v.issues, [])
        with self.assertRaisesRegex(voxel.VoxelError, "no array's"):
            v.grid("no", picture)

    def test_a_cut_connection_is_resumed_and_nothing_is_lost(self) -> None:
        for policy in ("clear", "keep", 30.0):
            with self.subTest(policy):
                self.cut_and_resume(policy)

    def cut_and_resume(self, policy: Any) -> None:
        path = f"{self.folder}/relay.{policy}.sock"
        relay = Relay(path, self.daemon.path)
        self.addCleanup(relay.close)
        v = self.connect(f"unix:{path}", on_disconnect=policy)
        owner = v.info.owner
        frames = []
        for number in range(60):
            frames.append(v.sphere(f"s{number:02}", radius=0.01 * (number + 1)).frame)
            if number % 20 == 10:
                relay.cut()
        for frame in frames:
            assert frame is not None
            self.assertEqual(frame.wait(LONG).state, "accepted")
        v.commit().wait_shown(LONG)
        observer = self.connect()
        self.assertEqual([e.key.id for e in observer.entities(owner=owner, timeout=LONG)], [f"s{n:02}" for n in range(60)])
        self.assertEqual((v.info.owner, v.counts["accepted"]), (owner, 61))
        self.assertGreater(v.counts["resumed"], 0)
        self.assertEqual(v.counts["streams_opened"], v.counts["resumed"] + 1, "every stream but the first is a resumed one")
        self.assertEqual(v.issues, [])

    def test_a_restarted_daemon_gets_the_scene_anew(self) -> None:
        v = self.connect()
        handle = v.layer("l", opacity=0.5).box("box", size=0.5)
        handle.transform = voxel.translate(0.25, 0, 0)
        with v.frame("live") as frame:
            frame.sphere("ball")
        frame.wait(LONG)
        self.daemon.kill()
        self.daemon.start()
        v.sphere("after")
        v.commit().wait(LONG)
        self.assertEqual(self.ids(v), ["after", "ball", "box"])
        (box,) = v.entities("l")
        self.assertEqual(box.transform.m[3], 0.25)
        self.assertEqual({layer.layer: layer.opacity for layer in v.layers()}, {"l": 128, "live": 255, "main": 255})

    def scene(self, v: voxel.Connection) -> Any:
        """Returns everything that determines what is drawn; not when, nor by which session."""
        layers = []
        for layer in sorted(v.layers(), key=lambda one: one.number):
            for field in ("owner", "number", "bytes", "client_name"):
                layer.ClearField(field)
            layers.append(str(layer))
        entities = []
        for entity in v.entities(timeout=LONG):
            entity.key.owner = 0
            for field in ("sequence", "expires_ns"):
                entity.ClearField(field)
            entities.append(str(entity))
        return layers, entities

    def draw_at_random(self, v: voxel.Connection, rng: random.Random) -> None:
        layer, name = v.layer(rng.choice("abc")), rng.choice("xyz")
        kind = rng.randrange(11)
        if kind < 2:
            layer.sphere(name, radius=rng.choice([0.1, 1e12]), color=rng.choice(["red", "lime"]))  # the one that is too large
        elif kind < 4:
            layer.instance(name, rng.choice("xyz"), transform=voxel.translate(rng.random(), 0, 0))
        elif kind == 4:
            with layer.frame() as frame:
                frame.box("b", size=rng.random() + 0.1)
                frame.instance(name, rng.choice("xyz"))
        elif kind == 5:
            layer.remove(name)
        elif kind == 6:
            layer.set(order=rng.randrange(3), opacity=rng.choice([0.5, 1]))
        elif kind == 7:
            layer.sphere(name).transform = rng.choice([voxel.translate(0.1, 0, 0), voxel.translate(1e12, 0, 0)])
        elif kind == 8 and rng.random() < 0.2:
            v.clear()
        elif kind == 9 and rng.random() < 0.5:
            v.remove_object(name, cascade=rng.random() < 0.5)
        else:
            with v.object(name) as block:
                block.cylinder("c", radius=0.1 + rng.random())
                if rng.random() < 0.4:
                    block.instance("i", rng.choice("xyz"))

    def test_what_was_accepted_comes_back_and_nothing_else(self) -> None:
        for strict in (False, True):
            rng = random.Random(f"{strict}")
            v = self.connect(strict=strict, on_issue=lambda issue: None)
            for turn in range(4):
                for _ in range(60):
                    with v.batch():
                        for _ in range(rng.choice([1, 1, 3])):
                            self.draw_at_random(v, rng)
                v.sphere("last of the turn").frame.wait(LONG)  # type: ignore[union-attr]
                before, counts = self.scene(v), v.counts
                self.daemon.kill()
                self.daemon.start()
                v.commit().wait(LONG)
                self.assertEqual(self.scene(v), before)
                self.assertEqual(v.counts["refused_operations"], counts["refused_operations"])
            self.assertGreater(v.counts["refused" if strict else "refused_operations"], 20)
            v.close()

    def test_a_scene_beyond_the_limits_of_a_commit_comes_back(self) -> None:
        self.daemon.kill()
        folder = tempfile.mkdtemp(dir=self.folder)
        with open(f"{folder}/small.toml", "w", encoding="utf-8") as file:
            file.write("[limits]\nmax_uncommitted_bytes = 3000000\nmax_operations_per_commit = 50\n")
        small = Daemon(folder, "--config", f"{folder}/small.toml")
        self.addCleanup(small.kill)
        v = self.connect(small.server)
        for number in range(200):
            v.sphere(f"s{number:03}", radius=0.1)
        for number in range(9):
            v.points(f"p{number}", np.full((60_000, 3), 0.01 * number, np.float32))
        v.commit().wait(LONG)
        before = self.scene(v)
        small.kill()
        small.start()
        v.commit().wait(LONG)
        self.assertEqual(self.scene(v), before)
        self.assertEqual(v.issues, [])

    def test_a_timed_commit_outlives_its_stream(self) -> None:
        for policy in ("clear", "keep"):
            path = f"{self.folder}/relay.{policy}.sock"
            relay = Relay(path, self.daemon.path)
            self.addCleanup(relay.close)
            v = self.connect(f"unix:{path}", on_disconnect=policy)
            v._transport.wait_until(v._session.clock.known, LONG)
            observer = self.connect()
            v.sphere("now").frame.wait(LONG)  # type: ignore[union-attr]
            due = v.server_time_ns() + 2_000_000_000
            v.autocommit = False
            v.sphere("later", radius=0.9)
            later = v.commit(present_at_ns=due)
            v._transport.wait_until(lambda: later.scheduled_ns != 0, LONG)
            relay.cut()
            v._transport.wait_until(lambda: v._session.resumed == 1, LONG)
            outcome = later.wait_shown(LONG)["stack"]
            self.assertEqual((outcome.kind, outcome.time_ns >= due, self.ids(observer)), ("presented", True, ["later", "now"]))
            observer.close()
            v.close()
            self.daemon.kill()
            self.daemon.start()

    def test_asyncio_sees_layers_and_changes(self) -> None:
        async def main() -> None:
            async with await voxel.aio.connect(self.daemon.server, timeout=LONG) as v:
                v.layer("a", opacity=0.5).sphere("s")
                await voxel.aio.accepted(v.commit(), LONG)
                self.assertEqual([layer.layer for layer in await v.layers(timeout=LONG)], ["a"])
                seen: list[str] = []
                async for change in v.watch_scene(timeout=LONG):
                    seen += [entity.info.key.id for entity in change.entities]
                    if len(seen) == 1:
                        v.sphere("t")
                    else:
                        break
                self.assertEqual(seen, ["s", "t"])

                async def watch() -> None:
                    async for _ in v.watch_scene():
                        ready.set()

                ready = asyncio.Event()
                task = asyncio.create_task(watch())
                await ready.wait()
                task.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await task

        asyncio.run(main())

    def test_a_session_may_be_taken_up_by_another(self) -> None:
        first = self.connect(on_disconnect="keep")
        first.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        second = self.connect(resume_token=first.resume_token, on_disconnect="keep")
        self.assertEqual((second.info.owner, second.counts["resumed"]), (first.info.owner, 1))
        with self.assertRaisesRegex(voxel.ConnectionLost, "taken up"):
            first._transport.wait_until(lambda: False, LONG)
        second.sphere("b").frame.wait(LONG)  # type: ignore[union-attr]
        self.assertEqual(self.ids(second), ["a", "b"])

    def test_an_owner_may_have_two_connections(self) -> None:
        first = self.connect()
        with first.object("ball") as ball:
            ball.sphere("s", radius=0.2)
        first.commit().wait(LONG)
        second = self.connect(owner_token=first.owner_token)
        frame = second.instance("i", "ball").frame
        assert frame is not None
        self.assertEqual((second.info.owner, frame.wait(LONG).issues), (first.info.owner, ()))

    def test_the_clock_is_the_machines(self) -> None:
        v = self.connect()
        v._transport.wait_until(v._session.clock.known, LONG)
        before = time.monotonic_ns()
        told, error = v.server_time_ns(), v.clock_error_ns
        after = time.monotonic_ns()
        assert error is not None
        self.assertLessEqual(before - error, told)
        self.assertLessEqual(told, after + error)

    def test_a_timed_commit_is_shown_when_it_was_asked_for(self) -> None:
        v = self.connect()
        v._transport.wait_until(v._session.clock.known, LONG)
        due = v.server_time_ns() + 300_000_000
        v.autocommit = False
        v.sphere("later")
        outcome = v.commit(present_at_ns=due).wait_shown(LONG)["stack"]
        self.assertEqual(outcome.kind, "presented")
        self.assertGreaterEqual(outcome.time_ns, due)
        v.sphere("soon")
        frame = v.commit(present_in=0.1, must_show=True)
        frame.wait_shown(LONG)
        self.assertGreater(frame.scheduled_ns, due)

    def test_latest_shows_the_newest_and_every_frame_is_accounted_for(self) -> None:
        v = self.connect(flow="latest", when_full="wait")
        frames = []
        for number in range(150):
            with v.frame("live") as frame:
                frame.points(f"p{number}", [[0.001 * number, 0, 0]] * 20_000)
            frames.append(frame.ticket)
        v.commit().wait_shown(LONG)
        self.assertEqual(frames[-1].state, "accepted")
        self.assertEqual(self.ids(v), ["p149"])
        stats, counts = v.stats(LONG), v.counts
        self.assertEqual({f.state for f in frames} - {"accepted", "dropped"}, set())
        self.assertEqual(counts["client_drops"], sum(f.state == "dropped" for f in frames))
        self.assertEqual(stats.client_drops, counts["client_drops"])
        self.assertEqual(stats.frames_dropped, counts["server_drops"])
        self.assertEqual(counts["accepted"] + counts["dropped"], 151)

    def test_a_picture_for_notebooks(self) -> None:
        v = self.connect()
        handle = v.box("b", fill="solid", color="red")
        handle.frame.wait_shown(LONG)  # type: ignore[union-attr]
        for shown in (v, handle, v.capture(timeout=LONG / 2)):
            self.assertEqual(shown._repr_mimebundle_()["image/png"][:8], b"\x89PNG\r\n\x1a\n")  # type: ignore[index]


if __name__ == "__main__":
    unittest.main()
