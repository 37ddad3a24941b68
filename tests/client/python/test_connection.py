"""Tests connections in realistic use: dropped connections, drawing from tasks and callbacks, and commits larger than can be sent at once."""
import asyncio
import gc
import os
import subprocess
import sys
import threading
import unittest
from typing import Any
from unittest import mock

import numpy as np
from plain_server import REFUSED, PlainServer
from served import LONG, Case

import voxeld as voxel
from voxeld import callbacks, transport
from voxeld.v1 import scene_pb2 as pb

THREE = np.zeros((200_000, 3), np.float32)  # is sent in three pieces
ONE = np.zeros((1, 3), np.float32)


class Dropped(Case):
    def test_a_connection_that_nobody_holds_is_closed(self) -> None:
        served = self.serve()
        v: Any = voxel.connect(f"unix:{self.path}", timeout=LONG)
        for number in range(50):
            v.sphere(f"s{number}")
        del v
        gc.collect()
        self.assertTrue(served.ended.acquire(timeout=LONG))
        self.assertEqual(len(served.plain.commits), 50, "what waited was sent first")

    def test_a_handle_holds_it(self) -> None:
        served = self.serve()
        handle = voxel.connect(f"unix:{self.path}", timeout=LONG).sphere("a")
        gc.collect()
        handle.update(color="red")
        assert handle.frame is not None
        handle.frame.wait(LONG)
        self.assertFalse(served.ended.acquire(blocking=False))
        handle._connection.close()  # type: ignore[attr-defined]

    def test_the_end_of_the_program_sends_what_waits(self) -> None:
        served = self.serve()
        program = (f"import voxeld\nv = voxeld.connect('unix:{self.path}', timeout={LONG})\n"
                   "for n in range(200): v.sphere(f's{n}')\n")
        subprocess.run([sys.executable, "-c", program], check=True, timeout=LONG, env=os.environ)
        self.assertTrue(served.ended.acquire(timeout=LONG))
        self.assertEqual(len(served.plain.commits), 200)


class Batches(Case):
    def test_a_batch_is_of_its_task(self) -> None:
        served = self.serve()
        v = self.connect()

        async def draw(name: str, fails: bool) -> None:
            try:
                with v.batch():
                    for number in range(3):
                        v.sphere(f"{name}{number}")
                        await asyncio.sleep(0)
                    if fails:
                        raise RuntimeError
            except RuntimeError:
                pass

        async def main() -> None:
            await asyncio.gather(draw("a", False), draw("b", True), draw("c", False))

        asyncio.run(main())
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["a0", "a1", "a2", "c0", "c1", "c2"])
        self.assertEqual(len(served.plain.commits), 3)

    def test_a_task_made_within_outlives_it(self) -> None:
        served = self.serve()
        v = self.connect()

        async def main() -> None:
            go = asyncio.Event()

            async def later() -> None:
                v.sphere("within")
                await go.wait()
                v.sphere("after")

            with v.batch():
                task = asyncio.create_task(later())
                await asyncio.sleep(0)
            go.set()
            await task

        asyncio.run(main())
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["after", "within"])
        self.assertEqual(len(served.plain.commits), 3)

    def test_batches_of_two_connections_are_apart(self) -> None:
        served = self.serve()
        v, w = self.connect(), voxel.connect(f"unix:{self.path}.other", wait=False)
        with v.batch(), w.batch():
            v.sphere("v")
            w.sphere("w")
        w.close(0)
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["v"])


class Pieces(Case):
    def test_what_was_not_taken_changes_nothing(self) -> None:
        served, v = self.stuck(buffer_bytes=3 << 20)
        served.credit.set()
        v.points("c", THREE).frame.wait(LONG)  # type: ignore[union-attr]
        served.credit.clear()
        first = v.sphere("first", label="x" * 200).frame
        v._transport.wait_until(lambda: first is not None and first.state != "waiting", LONG)
        v.layer("other").sphere("filler", label="x" * (5 << 19))
        with self.assertRaises(voxel.BufferFull):
            v.points("c", np.zeros((70_000, 3), np.float32))
        with self.assertRaises(voxel.BufferFull), v.frame() as frame:
            frame.points("c", np.zeros((70_000, 3), np.float32))
        served.credit.set()
        v.flush(LONG)
        v.commit().wait(LONG)
        self.assertEqual(len(self.ids(served)), 4)
        v.points("c", ONE)
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["c", "first"])

    def test_what_was_refused_changes_nothing(self) -> None:
        served = self.serve()
        v = self.connect(strict=True, on_issue=lambda issue: None)
        v.points("c", THREE)
        for change in (lambda: v.points("c", ONE), lambda: v.layer("main").remove("c"), lambda: v.clear("main")):
            with v.batch() as frames:
                change()
                v.sphere("bad", label=REFUSED)
            with self.assertRaises(voxel.CommitRefused):
                frames[0].wait(LONG)
            self.assertEqual(len(self.ids(served)), 3)
        v.points("c", ONE)
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["c"])
        self.assertEqual(len(v._pieces), 0, "nothing is kept of what is one piece")

    def test_a_block_that_raises_changes_nothing(self) -> None:
        served = self.serve()
        v = self.connect()
        v.points("c", THREE)
        with self.assertRaises(RuntimeError), v.batch():
            v.points("c", ONE)
            raise RuntimeError
        handle = v.points("c", np.zeros((100_000, 3), np.float32))
        handle.transform = voxel.translate(1, 0, 0)
        self.assertEqual(handle.frame.wait(LONG).issues, ())  # type: ignore[union-attr]
        self.assertEqual(len(self.ids(served)), 2)
        handle.remove()
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), [])

    def test_names_of_users_are_not_those_of_pieces(self) -> None:
        served = self.serve()
        v = self.connect()
        v.sphere("c/1")
        v.points("c", THREE)
        v.points("c", ONE)
        with self.assertRaisesRegex(voxel.InvalidValue, "give another"):
            v.sphere("c§1")
        v.commit().wait(LONG)
        self.assertEqual(self.ids(served), ["c", "c/1"])

    def test_twice_in_a_frame_is_once(self) -> None:
        served = self.serve()
        v = self.connect()
        with v.frame() as frame:
            frame.points("c", THREE)
            frame.points("c", ONE)
        frame.wait(LONG)
        self.assertEqual(self.ids(served), ["c"])


class Callbacks(Case):
    def test_they_may_want_what_a_drawer_holds(self) -> None:
        self.serve()
        v = self.connect()
        lock, told = threading.Lock(), threading.Event()

        def done(_: Any) -> None:
            with lock:
                told.set()

        with lock:
            v.sphere("a").frame.future().add_done_callback(done)  # type: ignore[union-attr]
            v.sphere("b").frame.wait(LONG)  # type: ignore[union-attr]
            self.assertFalse(told.is_set())
        self.assertTrue(told.wait(LONG))

    def test_they_may_wait(self) -> None:
        served = self.serve(PlainServer(window=1 << 16))
        drawn = threading.Event()

        def on_issue(issue: voxel.Issue) -> None:
            for number in range(9):
                v.points(f"c{number}", np.zeros((30_000, 3), np.float32))
            v.flush(LONG)
            v.commit().wait(LONG)
            drawn.set()

        v = self.connect(buffer_bytes=1 << 20, when_full="wait", on_issue=on_issue)
        v.sphere("bad", label=REFUSED)
        self.assertTrue(drawn.wait(LONG))
        self.assertEqual(len(self.ids(served)), 9)

    def test_all_is_told_before_close_is_back(self) -> None:
        self.serve()
        go, told = threading.Event(), []

        def on_issue(issue: voxel.Issue) -> None:
            go.wait(LONG)
            told.append(issue.id)

        v = self.connect(on_issue=on_issue)
        for number in range(20):
            v.sphere(f"s{number}", label=REFUSED)
        v.commit().wait(LONG)
        waiting = v._transport._callbacks
        drain = waiting.drain

        def close_waits(timeout: float) -> None:
            self.assertEqual(told, [])
            go.set()
            drain(timeout)

        with mock.patch.object(waiting, "drain", close_waits):
            v.close(LONG)
        self.assertEqual(len(told), 20)

    def test_a_slow_one_has_no_endless_queue(self) -> None:
        self.serve()
        go, told = threading.Event(), []

        def slow(issue: voxel.Issue) -> None:
            go.wait(LONG)
            told.append(issue.id)

        v = self.connect(on_issue=slow)
        with mock.patch.object(callbacks, "MOST_ISSUES", 5):
            for number in range(20):
                v.sphere(f"s{number}", label=REFUSED)
            v.commit().wait(LONG)
            with self.assertLogs("voxeld") as logs:
                go.set()
                v.close(LONG)
        self.assertIn(len(told), (5, 6))
        self.assertIn(f"{20 - len(told)} more", logs.output[0])


class Faults(Case):
    def test_an_answer_that_is_none_ends_a_stream_and_no_more(self) -> None:
        served = self.serve()
        v = self.connect()
        v.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        served.insert = [b"\xff\xff\xff"]
        self.assertEqual(v.sphere("b").frame.wait(LONG).state, "accepted")  # type: ignore[union-attr]
        self.assertEqual((self.ids(served), v.counts["streams_opened"]), (["a", "b"], 2))

    def test_an_answer_that_cannot_be_taken_too(self) -> None:
        self.serve()
        v = self.connect()
        with mock.patch.object(v._session.book, "receipt", side_effect=KeyError("of a newer server")):
            with self.assertLogs("voxeld"):
                frame = v.sphere("a").frame
                v._transport.wait_until(lambda: not v._session.open or v._session.streams_opened > 1, LONG)
        assert frame is not None
        v.wait_connected(LONG)
        self.assertEqual(v.sphere("b").frame.wait(LONG).state, "accepted")  # type: ignore[union-attr]

    def test_a_thread_that_fails_fails_the_connection(self) -> None:
        self.serve()
        v = self.connect()
        with mock.patch.object(v._session, "lost", side_effect=KeyError("what")), self.assertLogs("voxeld"):
            assert v._transport._call is not None
            v._transport._call.cancel()
            with self.assertRaisesRegex(voxel.ConnectionLost, "what"):
                v._transport.wait_until(lambda: False, LONG)

    def test_what_is_too_large_is_refused_before_there_is_a_connection(self) -> None:
        told: list[voxel.Issue] = []
        v = voxel.connect(f"unix:{self.path}", wait=False, on_issue=told.append)
        self.addCleanup(v.close)
        with v.object("huge") as block:
            for number in range(18):
                block.points(f"p{number}", np.zeros((80_000, 3), np.float32))
        after = v.sphere("after").frame
        served = self.serve()
        with self.assertRaisesRegex(voxel.CommitRefused, "max_message_bytes"):
            block.frame.wait(LONG)  # type: ignore[union-attr]
        after.wait(LONG)  # type: ignore[union-attr]
        self.assertEqual((self.ids(served), v.counts["streams_opened"]), (["after"], 1))
        v.flush(LONG)  # which applies only to what is sent
        v.close()
        self.assertEqual([issue.reason for issue in told], ["QUOTA_EXCEEDED"])
        self.assertRegex(str(told[0]), r"^commit: an operation of the commit has \d+ bytes .*max_message_bytes")

    def test_pauses_grow_while_nothing_is_answered(self) -> None:
        plain = PlainServer(max_message_bytes=1 << 20)
        attempts: list[int] = []
        enough = threading.Event()

        def pause(attempt: int, draw: Any) -> float:
            attempts.append(attempt)
            if len(attempts) >= 5:
                enough.set()
            return 0.0

        with mock.patch.object(transport, "backoff_s", pause):
            self.serve(plain)
            v = self.connect()
            v.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
            # The server reports one limit and applies another: the client cannot know what it will reject.
            plain.limits.max_message_bytes = 100
            with mock.patch.object(type(v._session), "most_bytes", 1 << 62):
                v.sphere("b", label="x" * 200)
                self.assertTrue(enough.wait(LONG))
                plain.limits.max_message_bytes = 1 << 20
                v.commit().wait(LONG)
        self.assertEqual(attempts[:5], [0, 1, 2, 3, 4])

    def test_a_dead_servers_keepalive_is_asked_for(self) -> None:
        options = dict(transport.CHANNEL_OPTIONS)
        self.assertLessEqual(options["grpc.keepalive_time_ms"] + options["grpc.keepalive_timeout_ms"], 30_000)


class Owner(Case):
    def test_a_restart_makes_a_new_owner_of_one_that_had_joined(self) -> None:
        served = self.serve()
        first = self.connect()
        joined = voxel.connect(f"unix:{self.path}", timeout=LONG, owner_token=first.owner_token)
        self.addCleanup(joined.close)
        self.assertEqual(joined.info.owner, first.info.owner)
        first.close()
        joined.sphere("a").frame.wait(LONG)  # type: ignore[union-attr]
        served.stop()
        again = self.serve()
        joined.sphere("b").frame.wait(LONG)  # type: ignore[union-attr]
        self.assertEqual(self.ids(again), ["a", "b"])


if __name__ == "__main__":
    unittest.main()
