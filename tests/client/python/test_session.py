"""Tests the client's state machine against a plain server, with connections that end at any moment."""
import random
import unittest

from plain_server import REFUSED, PlainServer, Refusal, Scene, Session as ServerSession, alone, apply
from test_outbox import frame, puts  # the same helper functions

from voxeld import draw, operations, shapes, wire
from voxeld.receipts import Frame, Issue
from voxeld.session import OWED_NS, Session, Settings
from voxeld.v1 import primitives_pb2, types_pb2
from voxeld.v1 import scene_pb2 as pb


class Wire:
    """A connection between the two, pumped by hand. What is on its way when the connection ends is lost."""

    def __init__(self, session: Session, server: PlainServer) -> None:
        self.session, self.server = session, server
        self.up = False
        self.token_lost = False
        self.answers: list[pb.StreamResponse] = []
        self.now = 0
        self.owner = 0  # the owner that was reported first

    def connect(self) -> None:
        self.server.begin()
        first = self.session.open_request()
        try:
            self.answers = self.server.receive(first)
        except LookupError:
            assert self.session.forget_token()
            self.session.lost()
            return self.connect()
        self.up = True
        assert self.session.next_request(self.now) is None, "nothing is sent before Opened"

    def cut(self) -> None:
        if self.up:
            # A token can be used once, and the next one is lost with Opened.
            self.token_lost = self.token_lost or not self.session.open
            self.up = False
            self.answers = []
            self.server.staged, self.server.timed = [], []
            self.session.lost()

    def send(self) -> bool:
        self.now += 1_000_000
        message = self.session.next_request(self.now)
        if message is None:
            return False
        self.answers += self.server.receive(message)
        return True

    def deliver(self, credit: bool = True) -> None:
        if credit:
            self.answers += self.server.give_credit()
        for answer in self.answers:
            self.session.answer(answer, self.now)
        self.answers = []
        if self.session.info is not None:
            self.owner = self.owner or self.session.info.owner

    def settle(self) -> None:
        """Pumps until nothing is left to do."""
        while True:
            self.deliver()
            if not self.send() and not self.answers:
                return


def puts_of(layer: str, id: str, label: str = "", uses: str = "", lifetime_ns: int = 0) -> operations.Puts:
    """Returns a sphere, or an instance of `uses`."""
    shape = shapes.instance(uses) if uses else shapes.sphere((0, 0, 0), 1)
    look = draw.Look(label=label, lifetime=lifetime_ns / 1e9 if lifetime_ns else None)
    return operations.Puts([wire.put(layer, id, look.to_bytes(), shape[0], uses, look.lifetime_ns)])


def define(name: str, uses: set[str], parts: int = 0) -> operations.Define:
    made = [wire.message(primitives_pb2.Object.Part())] * parts
    for used in sorted(uses):
        made.append(wire.message(primitives_pb2.Object.Part(
            primitive=primitives_pb2.Primitive(instance=primitives_pb2.Instance(object=used)))))
    return operations.define(name, made, uses)


class Expected:
    """The expected scene: every commit applied as it was made."""

    def __init__(self, strict: bool = False) -> None:
        self.strict = strict
        self.session = ServerSession()

    def commit(self, made: list[operations.Operation]) -> None:
        before, self.refused = self.session.state(), False
        for operation in made:
            self.add(operation)
        if self.strict and self.refused:
            self.session.set_state(before)

    def add(self, operation: operations.Operation) -> None:
        if isinstance(operation, operations.Puts):
            for put in operation.puts:
                self._apply(put.request)
        elif isinstance(operation, operations.Immediate):
            self.session.scene[operation.layer] = {}
            for part in operation.parts:
                self.add(part)
        else:
            self._apply(operation.request)

    def _apply(self, request: bytes) -> None:
        for one in alone(pb.StreamRequest.FromString(request)):
            try:
                apply(self.session, one)
            except Refusal:
                self.refused = True

    def random_operation(self, rng: random.Random, number: int, refusals: bool) -> operations.Operation:
        """`refusals`: the operation may be one that is refused."""
        layer, one, kind = rng.choice("abc"), rng.choice("xyz"), rng.random()
        size = rng.choice([0, 100, number])
        known = sorted(self.session.objects)
        if refusals and kind < 0.1:
            other = rng.choice("xyz".replace(one, ""))
            return operations.Puts([*puts(layer, one).puts, *puts_of(layer, other, REFUSED).puts])
        if kind < 0.3:
            return puts(layer, one, size=size)
        if kind < 0.35 and (refusals or known):
            return puts_of(layer, one, uses=rng.choice("xyz" if refusals else known))
        if kind < 0.45 and (refusals or one in self.session.scene.get(layer, {})):
            return operations.move(layer, one, [1, 0, 0, number, 0, 1, 0, 0, 0, 0, 1, 0])
        if kind < 0.55:
            return operations.delete_id(layer, one)
        if kind < 0.75:
            return frame(layer, size=size)
        if kind < 0.78:
            return operations.clear_layer(layer)
        if kind < 0.8:
            return operations.clear_all()
        if kind < 0.85:
            blend = rng.choice([types_pb2.BLEND_MODE_ADD, types_pb2.BLEND_MODE_OVER])
            return operations.layer_state(rng.choice([
                pb.LayerState(layer=layer, opacity=number % 256), pb.LayerState(layer=layer, visible=number % 2 == 0),
                pb.LayerState(layer=layer, blend=blend, order=-number)]))
        if kind < 0.95:
            uses = {name for name in ("xyz" if refusals else known) if name < one and rng.random() < 0.5}
            if refusals and rng.random() < 0.2:
                uses = {rng.choice("xyz")}  # perhaps a cycle
            return define(one, uses, number % 3)
        if not refusals and one not in known:
            return operations.delete_id(layer, one)
        return operations.undefine(one, not refusals or rng.random() < 0.5)


def filled(scene: Scene) -> Scene:
    return {layer: held for layer, held in scene.items() if held}


class Run:
    """Runs commits, losses and restarts at random, and then checks everything that must hold."""

    def __init__(self, test: unittest.TestCase, seed: object, flow: str, window: int, losses: float, restarts: float) -> None:
        rng = random.Random(f"{seed}")
        keep = 2
        kept = rng.random() < 0.5
        # Commits that are dropped, or kept without being reported, must not decide what is refused.
        refusals = flow == "reliable" and not (kept and losses) and rng.random() < 0.7
        strict = refusals and rng.random() < 0.5
        session = Session(Settings(flow=flow, keep_frames=keep, on_disconnect="keep" if kept else "clear", strict=strict))
        most = rng.choice([1000, 1 << 20])
        server = PlainServer(window, max_message_bytes=600, max_uncommitted_bytes=2 * most)
        wire_, expected = Wire(session, server), Expected(strict)
        frames: list[Frame] = []
        told: list[Issue] = []
        session.on_issue = told.append
        restarted = False
        for number in range(1, 80):
            ops = []
            trial = expected.session.state()
            for _ in range(rng.choice([0, 1, 1, 1, 3])):
                ops.append(expected.random_operation(rng, number, refusals))
                expected.add(ops[-1])
            expected.session.set_state(trial)
            expected.commit(ops)
            made = operations.Unit(session.new_frame(), ops, pb.Commit())
            test.assertTrue(session.submit(made))
            frames.append(made.frame)
            if not wire_.up and rng.random() < 0.4:
                wire_.connect()
            for _ in range(rng.randrange(6)):
                if wire_.up and not wire_.send():
                    break
            if wire_.up and rng.random() < 0.7:
                wire_.deliver(rng.random() < 0.5)
            if rng.random() < losses:
                wire_.cut()
                if rng.random() < restarts:
                    restarted = True
                    server.forget()
        if not wire_.up:
            wire_.connect()
        wire_.settle()
        test.assertTrue(session.idle())
        test.assertTrue(all(f.answered for f in frames), [f for f in frames if not f.answered])
        wire_.now += OWED_NS
        wire_.settle()
        assert server.session is not None
        test.assertEqual(filled(server.session.scene), filled(expected.session.scene))
        test.assertEqual(server.session.states, expected.session.states)
        test.assertEqual(server.session.objects, expected.session.objects)
        if not restarted:
            test.assertEqual(server.session.owner, wire_.owner)
        test.assertTrue(all(f.complete for f in frames), [f for f in frames if not f.complete])
        test.assertEqual(len(session.book), 0)
        states = {f.id: f.state for f in frames}
        test.assertNotIn("lost", states.values())
        test.assertNotIn("unknown", states.values())
        if flow == "reliable":
            test.assertEqual(session.outbox.dropped_frames, 0)
            test.assertEqual(list(server.session.scene), list(expected.session.scene), "layers keep their order")
        if not session.restored:
            test.assertEqual(server.commits, sorted(set(server.commits)), "each is applied once, and they keep their order")
        if not restarted:
            test.assertEqual(sorted(set(server.commits)), [f for f, state in states.items() if state == "accepted"])
            if not wire_.token_lost:
                test.assertEqual(server.client_drops, session.outbox.dropped_frames - session.outbox.unreported_drops)
        if not refusals:
            test.assertEqual(told, [])
        for one in frames:
            test.assertEqual(one.state == "refused", strict and bool(one.issues))
        self.drops, self.resumed, self.streams = session.outbox.dropped_frames, session.resumed, session.streams_opened
        self.restarted, self.restored = restarted, session.restored
        self.refused, self.told = sum(f.state == "refused" for f in frames), len(told)


class Any(unittest.TestCase):
    def runs(self, losses: float, restarts: float) -> list[Run]:
        return [Run(self, (seed, flow, window), flow, window, losses, restarts)
                for flow in ("reliable", "latest", "drop_oldest") for window in (0, 60, 400, 10_000) for seed in range(10)]

    def test_without_losses(self) -> None:
        runs = self.runs(0, 0)
        self.assertTrue(any(run.drops for run in runs))
        self.assertTrue(any(run.refused for run in runs))

    def test_with_losses_that_are_resumed(self) -> None:
        runs = self.runs(0.2, 0)
        self.assertGreater(sum(run.resumed for run in runs), 400)
        self.assertGreater(sum(run.refused for run in runs if run.restored), 100)
        self.assertGreater(sum(run.told for run in runs if run.restored), 200)

    def test_with_servers_that_forget(self) -> None:
        runs = self.runs(0.2, 0.5)
        self.assertGreater(sum(run.restarted for run in runs), 100)
        self.assertGreater(sum(run.resumed for run in runs), 100)


class Words(unittest.TestCase):
    def test_open_says_what_was_asked_for(self) -> None:
        opened = pb.StreamRequest.FromString(Session(Settings(
            client_name="c", on_disconnect=2.5, strict=True, flow="drop_oldest", keep_frames=3, outcomes=False,
            owner_token=b"o")).open_request()).open
        self.assertEqual(opened, pb.Open(
            client_name="c", on_disconnect=pb.DISCONNECT_POLICY_LINGER, linger_ns=2_500_000_000, strict=True,
            flow=pb.FLOW_POLICY_DROP_OLDEST, drop_oldest_frames=3, no_outcomes=True, owner_token=b"o"))

    def test_credit_is_kept_to(self) -> None:
        session, server = Session(Settings()), PlainServer(window=300)
        link = Wire(session, server)
        link.connect()
        link.deliver(credit=False)
        for _ in range(10):
            session.submit(operations.Unit(session.new_frame(), [puts("l", "x", size=100)], pb.Commit()))
        while link.send():
            pass
        self.assertGreaterEqual(server.received, 300, "all credit is used")
        self.assertLess(server.received, 300 + 200, "and one message may go beyond")
        self.assertFalse(session.idle())
        link.settle()
        self.assertEqual(len(server.commits), 10)

    def test_pings_come_at_once_and_then_seldom(self) -> None:
        session, server = Session(Settings()), PlainServer(window=1 << 20)
        link = Wire(session, server)
        link.connect()
        link.deliver()
        times = []
        for now in range(0, 100 * 10**9, 10**7):
            message = session.next_request(now)
            if message is not None:
                self.assertTrue(pb.StreamRequest.FromString(message).HasField("ping"))
                times.append(now)
                for answer in server.receive(message):
                    session.answer(answer, now + 10)
        self.assertEqual(times[0], 0)
        self.assertTrue(session.clock.known())
        self.assertTrue(8 < len(times) < 20, times)

    def test_a_server_without_pings_is_not_pinged(self) -> None:
        session = Session(Settings())
        session.open_request()
        session.answer(pb.StreamResponse(opened=pb.Opened()), 0)
        self.assertIsNone(session.next_request(10**12))
        self.assertIsNone(session.next_due_ns())

    def test_an_end_for_good_answers_everything(self) -> None:
        session = Session(Settings())
        frames = [session.new_frame() for _ in range(3)]
        for one in frames:
            session.submit(operations.Unit(one, [puts("l", "x")], pb.Commit()))
        session.fail("refused")
        self.assertEqual([f.state for f in frames], ["lost"] * 3)
        self.assertTrue(session.idle())


if __name__ == "__main__":
    unittest.main()
