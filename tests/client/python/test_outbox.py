"""Tests the outbox against a plain model: lists, and the rules of its contract."""
import random
import unittest
from typing import Optional

from voxeld import operations, wire
from voxeld.outbox import DROP_OLDEST, LATEST, RELIABLE, Outbox
from voxeld.receipts import Frame
from voxeld.v1 import primitives_pb2
from voxeld.v1 import scene_pb2 as pb

SPHERE = wire.message(primitives_pb2.Primitive(sphere=primitives_pb2.Sphere(radius=1)))


def puts(layer: str, *ids: str, size: int = 0) -> operations.Puts:
    return operations.Puts([wire.put(layer, id, pb.Entity(label="x" * size).SerializeToString(), SPHERE) for id in ids])


def frame(layer: str, size: int = 0) -> operations.Immediate:
    return operations.Immediate(layer, [puts(layer, "a", size=size)])


def unit(number: int, *ops: operations.Operation) -> operations.Unit:
    return operations.Unit(Frame(number), ops, pb.Commit())


def timed(number: int, *ops: operations.Operation) -> operations.Unit:
    return operations.Unit(Frame(number), ops, pb.Commit(present_at_ns=1 << 62))


def must_show(number: int, *ops: operations.Operation) -> operations.Unit:
    return operations.Unit(Frame(number), ops, pb.Commit(must_show=True))


class Model:
    """Units as lists of labels: ("frame", layer, number) or ("put", …). The policy is applied by examining everything."""

    def __init__(self, keep: Optional[int]) -> None:
        self.keep = keep
        self.units: list[tuple[int, list[tuple[str, str, int]]]] = []
        self.dropped = 0

    def push(self, number: int, ops: list[tuple[str, str, int]]) -> set[int]:
        self.units.append((number, list(ops)))
        gone = set()
        if self.keep is not None:
            for layer in {op[1] for _, held in self.units for op in held if op[0] == "frame"}:
                frames = [(held, op) for _, held in self.units for op in held if op[:2] == ("frame", layer)]
                for held, op in frames[:-self.keep]:
                    held.remove(op)
                    self.dropped += 1
        for one in list(self.units):
            if not one[1] and one[0] != number:
                gone.add(one[0])
                self.units.remove(one)
        return gone


class Policies(unittest.TestCase):
    def test_they_are_the_models(self) -> None:
        for policy, keep in ((RELIABLE, None), (LATEST, 1), (DROP_OLDEST, 1), (DROP_OLDEST, 3)):
            rng = random.Random(f"{policy}{keep}")
            for _ in range(100):
                box, model = Outbox(policy, keep or 1), Model(keep)
                labels: dict[int, tuple[str, str, int]] = {}
                for number in range(40):
                    if rng.random() < 0.3:
                        popped = box.pop()
                        expected = model.units.pop(0) if model.units else None
                        self.assertEqual(popped is None, expected is None)
                        if popped is not None and expected is not None:
                            self.assertEqual(popped.frame.id, expected[0])
                            self.assertEqual([labels[id(o)] for o in popped.operations], expected[1])
                        continue
                    ops: list[operations.Operation] = []
                    for at in range(rng.choice([1, 1, 1, 2, 3])):
                        layer = rng.choice("abc")
                        is_frame = rng.random() < 0.7
                        ops.append(frame(layer) if is_frame else puts(layer, str(at)))
                        labels[id(ops[-1])] = ("frame" if is_frame else "put", layer, number * 10 + at)
                        self.addCleanup(lambda o: None, ops[-1])  # keeps it alive, and so its id unique
                    gone = box.push(unit(number, *ops))
                    assert gone is not None
                    self.assertEqual({u.frame.id for u in gone}, model.push(number, [labels[id(o)] for o in ops]))
                    self.assertEqual([u.frame.id for u in box.units()], [u[0] for u in model.units])
                    self.assertEqual(box.bytes, sum(u.bytes for u in box.units()))
                    self.assertEqual(box.dropped_frames, model.dropped)

    def test_drops_are_reported_once(self) -> None:
        box = Outbox(LATEST)
        for number in range(5):
            box.push(unit(number, frame("a")))
        self.assertEqual(box.take_unreported(), 4)
        self.assertEqual(box.take_unreported(), 0)
        self.assertEqual(box.dropped_frames, 4)

    def test_a_frame_on_its_way_is_no_policys(self) -> None:
        box = Outbox(LATEST)
        box.push(unit(1, frame("a")))
        sent = box.pop()
        box.push(unit(2, frame("a")))
        assert sent is not None
        self.assertEqual(len(sent.operations), 1)
        self.assertEqual(box.dropped_frames, 0)


    def test_what_has_a_time_or_must_be_shown_is_not_given_up(self) -> None:
        for policy in (LATEST, DROP_OLDEST):
            box = Outbox(policy)
            for number, make in enumerate((timed, unit, must_show, unit, timed, must_show, unit)):
                box.push(make(number, frame("a")))
            self.assertEqual([u.frame.id for u in box.units()], [0, 2, 4, 5, 6])
            self.assertEqual(box.dropped_frames, 2)
            while box.pop():
                pass
            self.assertEqual(box.bytes, 0)

    def test_unconnected_they_are_kept_too(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        box.push(timed(0, frame("a", size=3000)), newest_only=True)
        box.push(must_show(1, frame("a", size=3000)), newest_only=True)
        for number in range(2, 5):
            self.assertIsNotNone(box.push(unit(number, frame("a", size=3000)), newest_only=True))
        self.assertEqual([u.frame.id for u in box.units()], [0, 1, 4])


class Room(unittest.TestCase):
    def test_without_room_nothing_is_taken(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        for number in range(3):
            self.assertEqual(box.push(unit(number, frame("a", size=3000))), [])
        before = box.bytes
        self.assertIsNone(box.push(unit(3, frame("a", size=3000))))
        self.assertEqual((box.bytes, len(box), box.dropped_frames), (before, 3, 0))

    def test_one_alone_may_be_larger(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        self.assertEqual(box.push(unit(1, frame("a", size=20_000))), [])
        self.assertIsNone(box.push(unit(2, puts("a", "x"))))

    def test_the_policy_makes_room(self) -> None:
        box = Outbox(LATEST, limit_bytes=10_000)
        for number in range(50):
            gone = box.push(unit(number, frame("a", size=6000)))
            self.assertEqual([u.frame.id for u in gone or []], [number - 1] if number else [])

    def test_unconnected_the_newest_of_each_layer_are_kept(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        for number in range(9):
            self.assertIsNotNone(box.push(unit(number, frame("ab"[number % 2], size=2500)), newest_only=True))
        kept = [u.frame.id for u in box.units()]
        self.assertEqual(kept[-2:], [7, 8])
        self.assertLessEqual(box.bytes, 10_000)
        self.assertEqual(box.dropped_frames, 9 - len(kept))

    def test_what_newer_puts_replace_goes_for_want_of_room(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        for number in range(100):
            self.assertIsNotNone(box.push(unit(number, puts("a", "x", size=3000))))
        self.assertGreater(box.merged_operations, 0)
        self.assertLessEqual(box.bytes, 10_000)
        left = [o for u in box.units() for o in u.operations]
        self.assertIsNotNone(left)
        self.assertIsNotNone(box.units()[-1].operations, "the newest is there")
        self.assertEqual([u.frame.id for u in box.units()], list(range(100)), "every commit still has its receipt")

    def test_what_comes_later_replaces_nothing_now(self) -> None:
        box = Outbox(RELIABLE, limit_bytes=10_000)
        for number, make in enumerate((must_show, timed, unit)):
            self.assertIsNotNone(box.push(make(number, puts("a", "x", size=3000))))
        self.assertIsNone(box.push(timed(3, puts("a", "x", size=3000))), "it takes effect later")
        self.assertEqual([len(u.operations) for u in box.units()], [1, 1, 1])
        self.assertIsNotNone(box.push(unit(4, puts("a", "x", size=3000))))
        self.assertEqual([len(u.operations) for u in box.units()], [1, 1, 0, 1])

    def test_merging_leaves_the_scene_as_it_would_be(self) -> None:
        from plain_server import PlainServer

        def play(units: list[operations.Unit]) -> object:
            server = PlainServer()
            server.begin()
            server.receive(pb.StreamRequest(open=pb.Open()).SerializeToString())
            for one in units:
                for message in one.requests():
                    server.receive(message)
                server.receive(pb.StreamRequest(commit=pb.Commit(frame_id=1)).SerializeToString())
            assert server.session is not None
            return {layer: held for layer, held in server.session.scene.items() if held}

        rng = random.Random(5)
        merged = 0
        for _ in range(200):
            box, pushed = Outbox(RELIABLE, limit_bytes=4000), []
            there: set[tuple[str, str]] = set()
            for number in range(30):
                ops: list[operations.Operation] = []
                for _ in range(rng.choice([1, 2])):
                    layer, one = rng.choice("ab"), rng.choice("xyz")
                    kind = rng.random()
                    if kind < 0.5:
                        ops.append(puts(layer, one, size=rng.choice([0, 500])))
                        there.add((layer, one))
                    elif kind < 0.7 and (layer, one) in there:
                        ops.append(operations.move(layer, one, [1, 0, 0, number, 0, 1, 0, 0, 0, 0, 1, 0]))
                    elif kind < 0.8:
                        ops.append(operations.delete_id(layer, one))
                        there.discard((layer, one))
                    elif kind < 0.9:
                        ops.append(frame(layer))
                        there = {t for t in there if t[0] != layer} | {(layer, "a")}
                    elif kind < 0.95:
                        ops.append(operations.clear_layer(layer))
                        there = {t for t in there if t[0] != layer}
                    else:
                        ops.append(operations.clear_all())
                        there.clear()
                if box.push(unit(number, *ops)) is None:
                    break
                pushed.append(unit(number, *ops))
            self.assertEqual(play(box.units()), play(pushed))
            merged += box.merged_operations
        self.assertGreater(merged, 200)


if __name__ == "__main__":
    unittest.main()
