"""Connections over real gRPC, to the plain server behind a real socket."""
import asyncio
import threading
import unittest
from typing import Any

import grpc
import numpy as np
from plain_server import REFUSED, PlainServer
from served import LONG, Case, Served

import voxeld as voxel
from voxeld import transport
from voxeld.v1 import primitives_pb2
from voxeld.v1 import scene_pb2 as pb

class Streams(Case):
    def test_what_is_drawn_arrives(self) -> None:
        served, cloud = self.serve(), np.arange(30, dtype=np.float32).reshape(10, 3)
        v = self.connect()
        handle = v.points("cloud", cloud, colors="red")
        assert handle.frame is not None
        self.assertEqual(handle.frame.wait_shown(LONG)["d"].kind, "presented")
        assert served.plain.session is not None
        entity = pb.Entity.FromString(served.plain.session.scene["main"]["cloud"])
        self.assertEqual(entity.primitive.points.vertices.positions, cloud.tobytes())
        self.assertEqual(entity.primitive.color.rgb, 0xFF0000)

    def test_a_lost_stream_is_resumed(self) -> None:
        served = self.serve()
        v = self.connect(on_disconnect="keep")
        v.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        served.cut.set()
        frame = v.sphere("b").frame
        assert frame is not None
        self.assertEqual(frame.wait(LONG).state, "accepted")
        self.assertEqual((v.counts["streams_opened"], v.counts["resumed"]), (2, 1))
        self.assertEqual(self.ids(served), ["a", "b"])
        self.assertEqual(served.plain.commits, [1, 2])

    def test_a_server_that_forgot_gets_the_scene_anew(self) -> None:
        served = self.serve()
        v = self.connect()
        v.layer("l", opacity=0.5).sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        served.plain.forget()
        served.cut.set()
        v.sphere("b")
        v.wait_connected(LONG)
        v.box("c").frame.wait(LONG)  # type: ignore[union-attr]
        assert served.plain.session is not None
        self.assertEqual((self.ids(served), self.ids(served, "l")), (["b", "c"], ["a"]))
        self.assertEqual(served.plain.session.states["l.opacity"], 128)
        self.assertEqual(v.counts["resumed"], 0)

    def test_a_restarted_server_is_found_again(self) -> None:
        first = self.serve()
        v = self.connect()
        v.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        first.stop()
        v.sphere("b")
        second = self.serve()
        v.commit().wait(LONG)
        self.assertEqual(self.ids(second), ["a", "b"])

    def test_drawing_may_come_before_the_server(self) -> None:
        v = voxel.connect(f"unix:{self.path}", wait=False)
        self.addCleanup(v.close)
        frame = v.sphere("a").frame
        assert frame is not None
        served = self.serve()
        frame.wait(LONG)
        self.assertEqual(self.ids(served), ["a"])

    def test_nobody_there_is_said(self) -> None:
        with self.assertRaisesRegex(voxel.ConnectionLost, f"unix:{self.path}.*is it running"):
            voxel.connect(f"unix:{self.path}", timeout=0.5)

    def test_a_refusal_is_final(self) -> None:
        served = self.serve()
        served.refuse = grpc.StatusCode.PERMISSION_DENIED
        v = voxel.connect(f"unix:{self.path}", wait=False)
        self.addCleanup(v.close)
        with self.assertRaisesRegex(voxel.ConnectionLost, "PERMISSION_DENIED: not you"):
            v.wait_connected(LONG)
        with self.assertRaisesRegex(voxel.ConnectionLost, "not you"):
            v.sphere("a")

    def test_closing_sends_what_waits(self) -> None:
        served = self.serve()
        v = self.connect()
        for number in range(200):
            v.sphere(f"s{number:03}")
        v.close(LONG)
        self.assertEqual(len(served.plain.commits), 200)
        with self.assertRaisesRegex(voxel.ConnectionLost, "closed"):
            v.sphere("more")

    def test_threads_may_draw_at_once(self) -> None:
        served = self.serve()
        v = self.connect()

        def draw(thread: int) -> None:
            for number in range(20):
                with v.batch():
                    v.sphere(f"{thread}.{number}")
                    v.box(f"{thread}.{number}.box")

        threads = [threading.Thread(target=draw, args=(n,)) for n in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(LONG)
        v.commit().wait(LONG)
        self.assertEqual(len(self.ids(served)), 160)
        self.assertEqual(len(served.plain.commits), 81)

    def test_who_is_told_may_draw(self) -> None:
        served = self.serve()
        drawn: list[voxel.Handle] = []
        v = self.connect(on_issue=lambda issue: drawn.append(v.sphere("instead of " + issue.id)))
        frame = v.sphere("a", label=REFUSED).frame
        assert frame is not None
        frame.future().add_done_callback(lambda _: drawn.append(v.sphere("after it")))
        self.assertEqual([issue.id for issue in frame.wait(LONG).issues], ["a"])
        v._transport.wait_until(lambda: len(drawn) == 2, LONG)
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["after it", "instead of a"])
        self.assertEqual([issue.message for issue in v.issues], ["refused"])

    def test_a_broken_on_issue_ends_nothing(self) -> None:
        self.serve()
        v = self.connect(on_issue=lambda issue: 1 / 0)
        with self.assertLogs("voxeld") as logs:
            v.sphere("a", label=REFUSED)
            v.commit().wait(LONG)
            v._transport._callbacks.drain(LONG)
            v.commit().wait(LONG)
        self.assertIn("ZeroDivisionError", logs.output[0])
        self.assertEqual(v.counts["streams_opened"], 1)

    def test_closing_waits_for_a_connection_that_comes_back(self) -> None:
        first = self.serve()
        v = self.connect()
        first.stop()
        v._transport.wait_until(lambda: not v.connected, LONG)
        v.sphere("a")
        closing = threading.Thread(target=v.close, args=(LONG,))
        closing.start()
        second = self.serve()
        closing.join(LONG)
        self.assertEqual(self.ids(second), ["a"])

    def test_pauses_grow_to_a_bound(self) -> None:
        for draw in (0.0, 1.0):
            pauses = [transport.backoff_s(n, lambda: draw) for n in range(100)]
            self.assertEqual(pauses, sorted(pauses))
            self.assertGreaterEqual(pauses[0], 0.5 * transport.BACKOFF_FIRST_S)
            self.assertLessEqual(pauses[-1], transport.BACKOFF_MOST_S)


class Flow(Case):
    def test_latest_keeps_the_newest_of_each_layer_and_counts(self) -> None:
        served, v = self.stuck(flow="latest")
        frames = []
        for number in range(10):
            for layer in "ab":
                with v.frame(layer) as frame:
                    frame.sphere(f"s{number}")
                frames.append(frame)
        self.assertEqual([f.ticket.state for f in frames], ["dropped"] * 18 + ["waiting"] * 2)
        with self.assertRaisesRegex(voxel.CommitDropped, "newer frames"):
            frames[0].wait(0)
        served.credit.set()
        v.flush(LONG)
        frames[-1].wait(LONG)
        self.assertEqual((self.ids(served, "a"), self.ids(served, "b")), (["s9"], ["s9"]))
        self.assertEqual((v.counts["client_drops"], served.plain.client_drops), (18, 18))

    def test_retained_things_wait_under_every_policy(self) -> None:
        served, v = self.stuck(flow="latest")
        for number in range(50):
            v.sphere(f"s{number}")
        served.credit.set()
        v.commit().wait(LONG)
        self.assertEqual(len(self.ids(served)), 50)
        self.assertEqual(v.counts["client_drops"], 0)

    def test_a_full_buffer_raises_and_takes_nothing(self) -> None:
        served, v = self.stuck(buffer_bytes=1 << 20)
        cloud = np.zeros((30_000, 3), np.float32)
        for number in range(2):
            v.points(f"c{number}", cloud)
        with self.assertRaisesRegex(voxel.BufferFull, "flush"):
            v.points("c2", cloud)
        served.credit.set()
        v.flush(LONG)
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["c0", "c1"])

    def test_a_full_buffer_waits_when_asked_to(self) -> None:
        served, v = self.stuck(buffer_bytes=1 << 20, when_full="wait")
        cloud = np.zeros((30_000, 3), np.float32)
        done = threading.Event()

        def draw() -> None:
            for number in range(9):
                v.points(f"c{number}", cloud)
            done.set()

        thread = threading.Thread(target=draw)
        thread.start()
        v._transport.wait_until(lambda: v._session.outbox.bytes > 700_000, LONG)
        self.assertFalse(done.is_set())
        served.credit.set()
        thread.join(LONG)
        v.commit().wait(LONG)
        self.assertEqual(len(self.ids(served)), 9)


class Drawing(Case):
    def test_handles_send_what_changed(self) -> None:
        served = self.serve()
        v = self.connect()
        handle = v.sphere("a", radius=2, color="red", priority=3)
        handle.transform = voxel.translate(1, 2, 3)
        handle.update(color="lime")
        v.commit().wait(LONG)
        assert served.plain.session is not None
        entity = pb.Entity.FromString(served.plain.session.scene["main"]["a"])
        self.assertEqual((entity.primitive.sphere.radius, entity.primitive.color.rgb, entity.priority), (2, 0x00FF00, 3))
        self.assertEqual([entity.transform.m[3], entity.transform.m[7], entity.transform.m[11]], [1, 2, 3])
        np.testing.assert_array_equal(handle.transform, voxel.translate(1, 2, 3))
        with self.assertRaisesRegex(voxel.InvalidValue, r"sphere\(\) has no option 'size'"):
            handle.update(size=3)
        with self.assertRaises(voxel.InvalidArray):
            handle.update((0, 0, 0), -1)
        handle.update(priority=4)
        v.commit().wait(LONG)
        entity = pb.Entity.FromString(served.plain.session.scene["main"]["a"])
        self.assertEqual((entity.primitive.sphere.radius, entity.priority), (2, 4), "a refused update changed nothing")
        handle.remove()
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), [])

    def test_colours_of_an_update_need_no_map_of_those_before(self) -> None:
        served = self.serve()
        v = self.connect()
        points = np.zeros((6, 3), np.float32)
        cloud = v.points("c", points, colors=np.arange(6.0), cmap="viridis")

        def looks() -> pb.Entity:
            v.commit().wait(LONG)
            assert served.plain.session is not None
            return pb.Entity.FromString(served.plain.session.scene["main"]["c"])

        self.assertTrue(looks().primitive.points.vertices.colors)
        cloud.update(colors=np.arange(6.0)[::-1])
        self.assertTrue(looks().primitive.points.vertices.colors, "numbers again: the map stays")
        cloud.update(colors="red")
        entity = looks()
        self.assertFalse(entity.primitive.points.vertices.colors)
        self.assertEqual(entity.primitive.color.rgb, 0xFF0000)

    def test_large_clouds_are_one_thing(self) -> None:
        served = self.serve()
        v = self.connect()
        counts = (200_000, 10, 0, 100_000, 300_000, 1, 90_000)
        handle = v.points("c", np.zeros((5, 3), np.float32))
        for count in counts:
            handle.update(np.zeros((count, 3), np.float32))
            handle.transform = voxel.translate(count, 0, 0)
            v.commit().wait(LONG)
            assert served.plain.session is not None
            held = [pb.Entity.FromString(e) for e in served.plain.session.scene["main"].values()]
            self.assertEqual(sum(e.primitive.points.vertices.count for e in held), count)
            self.assertTrue(all(e.transform.m[3] == count for e in held))
        with v.frame("main") as frame:
            frame.points("c", np.zeros((200_000, 3), np.float32))
        v.points("c", np.zeros((1, 3), np.float32))
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["c"], "what a frame left of it is replaced too")

    def test_batches_and_commits(self) -> None:
        served = self.serve()
        v = self.connect(autocommit=False)
        v.sphere("a")
        with v.batch():
            v.sphere("b")
        with self.assertRaises(RuntimeError), v.batch():
            v.sphere("c")
            raise RuntimeError
        with self.assertRaises(RuntimeError), v.frame("main") as frame:
            frame.sphere("d")
            raise RuntimeError
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["a", "b"])
        self.assertEqual(len(served.plain.commits), 1)
        v.autocommit = True
        with v.batch() as frames:
            v.sphere("c")
            v.clear("other")
            with self.assertRaisesRegex(voxel.InvalidValue, "at its end"):
                v.commit()
        frames[0].wait(LONG)
        self.assertEqual(len(served.plain.commits), 2)
        v.clear().wait(LONG)  # type: ignore[union-attr]
        self.assertEqual(self.ids(served), [])

    def test_objects(self) -> None:
        served = self.serve()
        v = self.connect()
        with v.object("wheel") as wheel:
            wheel.cylinder("tyre", radius=2, transform=voxel.rotate("x", 90))
            wheel.points("dots", np.zeros((100_000, 3)))
            with self.assertRaisesRegex(voxel.InvalidValue, "only a transform"):
                wheel.sphere("hub", priority=3)
        v.instance("left", "wheel", transform=voxel.translate(1, 0, 0))
        v.commit().wait(LONG)
        assert served.plain.session is not None
        definition = primitives_pb2.Object.FromString(served.plain.session.objects["wheel"])
        self.assertEqual([p.primitive.WhichOneof("kind") for p in definition.parts], ["cylinder", "points", "points"])
        v.remove_object("wheel", cascade=True).wait(LONG)  # type: ignore[union-attr]
        self.assertEqual(served.plain.session.objects, {})

    def test_arguments_are_checked_before_anything_is_sent(self) -> None:
        self.serve()
        v = self.connect()
        for call, words in ((lambda: v.points("", [[0, 0, 0]]), "not empty"), (lambda: v.sphere("a", priority=127), "0 to 126"),
                            (lambda: v.layer("l", opacity=128), "0 to 1"), (lambda: v.layer("l", blend="multiply"), "'over'"),
                            (lambda: v.sphere("a", lifetime=-1), "lifetime"), (lambda: v.points("a", np.zeros((3, 9))), ".T"),
                            (lambda: voxel.connect(flow="newest"), "'latest'"),
                            (lambda: voxel.connect(on_disconnect="stay"), "'keep'")):
            with self.assertRaisesRegex(voxel.VoxelError, words):
                call()
        self.assertEqual(v.counts["commits"], 0)

    def test_notebooks_get_text_where_there_is_no_picture(self) -> None:
        self.serve()
        v = self.connect()
        bundle = v._repr_mimebundle_()
        self.assertNotIn("image/png", bundle)
        self.assertIn("no picture: unimplemented", bundle["text/plain"])

    def test_the_servers_clock_is_known(self) -> None:
        served = self.serve(PlainServer(window=1 << 20))
        v = self.connect()
        v._transport.wait_until(v._session.clock.known, LONG)
        self.assertLess(abs(v.server_time_ns() - served.plain.now_ns), LONG * 1e9)
        self.assertIsNotNone(v.clock_error_ns)


class Async(Case):
    def test_what_waits_is_awaited(self) -> None:
        served = self.serve()

        async def main() -> None:
            async with await voxel.aio.connect(f"unix:{self.path}", timeout=LONG) as v:
                v.sphere("a")
                with v.frame("l") as frame:
                    frame.box("b")
                self.assertEqual((await voxel.aio.shown(frame, LONG))["d"].kind, "presented")
                self.assertEqual((await voxel.aio.accepted(v.commit(), LONG)).state, "accepted")
                await v.flush(LONG)

        asyncio.run(main())
        self.assertEqual((self.ids(served), self.ids(served, "l")), (["a"], ["b"]))

    def test_nobody_there_is_said(self) -> None:
        with self.assertRaisesRegex(voxel.ConnectionLost, "is it running"):
            asyncio.run(voxel.aio.connect(f"unix:{self.path}", timeout=0.5))


if __name__ == "__main__":
    unittest.main()
