"""Tests the state of the scene and of commits after a stream ends, case by case; test_session has everything at random."""
import unittest
from typing import Any

from plain_server import NOTED, REFUSED, PlainServer
from test_outbox import puts
from test_session import Wire, define, puts_of

from voxeld import operations, shapes, wire
from voxeld.receipts import Frame, Issue
from voxeld.session import OWED_NS, Session, Settings
from voxeld.v1 import scene_pb2 as pb

SECOND = 10**9


class Case(unittest.TestCase):
    def start(self, server: PlainServer, **settings: Any) -> None:
        self.session, self.server = Session(Settings(**settings)), server
        self.link = Wire(self.session, server)
        self.issues: list[Issue] = []
        self.session.on_issue = self.issues.append
        self.link.connect()
        self.link.deliver()

    def commit(self, *made: operations.Operation, **options: Any) -> Frame:
        unit = operations.Unit(self.session.new_frame(), made, pb.Commit(**options))
        self.assertTrue(self.session.submit(unit))
        return unit.frame

    def send_all(self) -> None:
        while self.link.send():
            pass

    def again(self, forget: bool = False) -> None:
        """Ends the stream and starts another."""
        self.link.cut()
        if forget:
            self.server.forget()
        self.link.connect()
        self.link.settle()

    def ids(self, layer: str = "l") -> list[str]:
        assert self.server.session is not None
        return sorted(self.server.session.scene.get(layer, {}))

    def entity(self, id: str, layer: str = "l") -> pb.Entity:
        assert self.server.session is not None
        return pb.Entity.FromString(self.server.session.scene[layer][id])


class Accepted(Case):
    """Only what the server accepted is sent again."""

    def test_a_refused_put_does_not_replace_the_good_one(self) -> None:
        self.start(PlainServer())
        self.commit(puts_of("l", "x", "good"))
        frame = self.commit(puts_of("l", "x", REFUSED), puts_of("l", "y"))
        self.link.settle()
        self.assertEqual((frame.state, [i.id for i in frame.issues]), ("accepted", ["x"]))
        self.again(forget=True)
        self.assertEqual((self.ids(), self.entity("x").label), (["x", "y"], "good"))
        self.assertEqual(len(self.issues), 1, "it is not refused once more")

    def test_what_was_carried_out_otherwise_is_put_up_again(self) -> None:
        self.start(PlainServer())
        frame = self.commit(puts_of("l", "x", NOTED))
        self.link.settle()
        self.assertEqual((frame.state, [(i.id, i.applied) for i in frame.issues]), ("accepted", [("x", True)]))
        self.again(forget=True)
        self.assertEqual((self.ids(), self.entity("x").label), (["x"], NOTED))

    def test_one_refusal_does_not_poison_a_strict_session(self) -> None:
        self.start(PlainServer(), strict=True)
        self.commit(puts_of("l", "x", "good"))
        refused = self.commit(puts_of("l", "x", REFUSED), puts_of("l", "y"))
        self.link.settle()
        self.assertEqual(refused.state, "refused")
        for _ in range(3):
            self.again(forget=True)
            self.assertEqual(self.ids(), ["x"])
        self.assertEqual(self.entity("x").label, "good")

    def test_a_refused_frame_leaves_the_layer(self) -> None:
        self.start(PlainServer(max_operations=3))
        self.commit(puts("l", "x"))
        # The batch, the frame's beginning and its entity make three; the frame's end is one too many.
        self.commit(puts("m", "1"), puts_of("n", "2"), operations.Immediate("l", [puts("l", "z")]))
        self.link.settle()
        self.assertEqual(self.ids(), ["x"])
        self.again(forget=True)
        self.assertEqual((self.ids(), self.ids("m"), self.ids("n")), (["x"], ["1"], ["2"]))

    def test_a_frame_may_be_refused_in_part(self) -> None:
        self.start(PlainServer())
        self.commit(puts("l", "x"))
        self.commit(operations.Immediate("l", [puts_of("l", "z", REFUSED), puts("l", "y")]))
        self.link.settle()
        self.again(forget=True)
        self.assertEqual((self.ids(), len(self.issues)), (["y"], 1))

    def test_a_refused_removal_of_an_object_keeps_it(self) -> None:
        self.start(PlainServer())
        self.commit(define("o", set()), puts_of("l", "i", uses="o"))
        frame = self.commit(operations.undefine("o", cascade=False))
        self.link.settle()
        self.assertEqual([i.reason for i in frame.issues], ["IN_USE"])
        self.again(forget=True)
        self.assertEqual((self.ids(), len(self.issues)), (["i"], 1))
        self.commit(define("user", {"o"}, 2), operations.undefine("o", cascade=True))
        self.link.settle()
        self.again(forget=True)
        assert self.server.session is not None
        self.assertEqual((self.ids(), list(self.server.session.objects), len(self.issues)), ([], ["user"], 1))

    def test_objects_are_defined_before_their_users(self) -> None:
        self.start(PlainServer())
        self.commit(define("first", set()), define("second", set()))
        self.commit(define("first", {"second"}), puts_of("l", "i", uses="first"))
        self.link.settle()
        self.again(forget=True)
        self.assertEqual((self.ids(), self.issues), (["i"], []))

    def test_layers_keep_their_order(self) -> None:
        self.start(PlainServer())
        self.commit(puts("plain", "x"))
        self.commit(operations.layer_state(pb.LayerState(layer="stated", opacity=9)), puts("stated", "x"))
        self.commit(operations.delete_id("never made", "x"), puts("emptied", "x"), puts("last", "x"))
        self.commit(operations.delete_id("emptied", "x"))
        self.link.settle()
        self.again(forget=True)
        assert self.server.session is not None
        self.assertEqual(list(self.server.session.scene), ["plain", "stated", "emptied", "last"])

    def test_instances_of_others_objects_take_nothing_along(self) -> None:
        self.start(PlainServer(), strict=True)
        assert self.server.session is not None
        self.server.session.objects["another's"] = b""
        self.commit(puts_of("l", "i", uses="another's"))
        self.commit(puts("l", "x"))
        self.link.settle()
        self.again(forget=True)
        self.assertEqual(self.ids(), ["x"])
        self.assertIn("not put up again", self.issues[-1].message)

    def test_what_expired_is_forgotten(self) -> None:
        self.start(PlainServer())
        for number in range(100):
            self.commit(puts_of("l", f"short{number}", lifetime_ns=SECOND))
        self.commit(puts_of("l", "long", lifetime_ns=100 * SECOND))
        self.link.settle()
        self.assertEqual(len(self.session.mirror), 101)
        self.link.now += 2 * SECOND
        self.commit(puts("l", "after"))
        self.link.settle()
        self.assertEqual(len(self.session.mirror), 2)
        self.again(forget=True)
        self.assertEqual(self.ids(), ["after", "long"])
        self.assertLessEqual(self.entity("long").lifetime_ns, 98 * SECOND, "what is left of it")
        self.assertGreater(self.entity("long").lifetime_ns, 90 * SECOND)
        self.link.now += 100 * SECOND
        self.again(forget=True)
        self.assertEqual(self.ids(), ["after"], "nor if nothing was committed since")

    def test_what_is_renewed_for_ever_is_held_once(self) -> None:
        mirror = self.start(PlainServer()) or self.session.mirror
        for _ in range(5000):
            self.commit(puts_of("l", "x", lifetime_ns=10**15))
        self.link.settle()
        self.assertLess(len(mirror._ends), 200)

    def test_a_scene_beyond_the_limits_comes_in_several_commits(self) -> None:
        server = PlainServer(window=2000, max_message_bytes=1000, max_uncommitted_bytes=5000, max_operations=20)
        self.start(server)
        for number in range(100):
            self.commit(puts("l", f"{number:03}", size=number % 50 * 10))
        self.link.settle()
        before = self.ids()
        self.again(forget=True)
        self.assertEqual((self.ids(), self.issues), (before, []))
        self.assertLessEqual(max(server.commit_bytes), 5000)

    def test_a_scene_half_sent_is_begun_anew(self) -> None:
        server = PlainServer(max_uncommitted_bytes=4000)
        self.start(server, on_disconnect="keep")
        for number in range(50):
            self.commit(puts("l", f"{number:02}", size=200))
        self.link.settle()
        before = self.ids()
        self.link.cut()
        server.forget()
        for sent in range(1, 40, 3):
            self.link.connect()
            self.link.deliver()
            for _ in range(sent):
                self.link.send()
            self.link.deliver()
            self.assertFalse(self.session.idle() and len(self.ids()) < 50)
            self.link.cut()
        self.again()
        self.assertEqual(self.ids(), before)

    def test_flushing_waits_for_the_scene(self) -> None:
        self.start(PlainServer(max_uncommitted_bytes=4000))
        for number in range(50):
            self.commit(puts("l", f"{number:02}", size=200))
        self.link.settle()
        self.link.cut()
        self.server.forget()
        self.link.connect()
        self.link.deliver()
        while self.link.send():
            self.assertEqual(self.session.idle(), len(self.server.staged) == 0 and len(self.ids()) == 50)
        self.assertTrue(self.session.idle())


class Unanswered(Case):
    """Commits that had no answer when their stream ended."""

    def cut_with(self, *units: Any, applied: int) -> list[Frame]:
        """The commits are sent, and no answer arrives; the server has handled the first `applied` requests."""
        frames = [self.commit(*made) for made in units]
        for _ in range(applied):
            self.link.send()
        return frames

    def test_where_layers_are_kept_what_was_applied_is_not_sent_again(self) -> None:
        self.start(PlainServer(), on_disconnect="keep")
        frames = self.cut_with([puts("l", "a")], [puts("l", "b")], [puts("l", "c")], applied=4)
        self.again()
        self.assertEqual([f.state for f in frames], ["accepted"] * 3)
        self.assertEqual(self.server.commits, [1, 2, 3])
        self.again(forget=True)
        self.assertEqual(self.ids(), ["a", "b", "c"])

    def test_of_a_strict_session_it_is_not_known(self) -> None:
        self.start(PlainServer(), on_disconnect="keep", strict=True)
        frames = self.cut_with([puts_of("l", "a", REFUSED)], [puts("l", "b")], [puts("l", "c")], applied=4)
        self.again()
        self.assertEqual([f.state for f in frames], ["unknown", "accepted", "accepted"])
        with self.assertRaisesRegex(ConnectionError, "refused it is not known"):
            frames[0].wait(0)
        self.assertEqual(self.session.book.counts["unknown"], 1)
        self.again(forget=True)
        self.assertEqual(self.ids(), ["b", "c"], "what may have been refused is not put up")

    def test_where_layers_went_it_is_judged_again(self) -> None:
        for strict in (False, True):
            self.start(PlainServer(), strict=strict)
            frames = self.cut_with([puts_of("l", "a", REFUSED)], [puts("l", "b")], [puts("l", "c")], applied=5)
            self.again()
            self.assertEqual([f.state for f in frames], ["refused" if strict else "accepted", "accepted", "accepted"])
            self.assertEqual([i.id for i in frames[0].issues], ["a"])
            self.assertEqual(self.ids(), ["b", "c"])

    def test_a_timed_one_that_waited_waits_again(self) -> None:
        for policy in ("keep", "clear", 5.0):
            self.start(PlainServer(), on_disconnect=policy)
            later = self.commit(puts("l", "later"), present_at_ns=9000)
            self.commit(puts("l", "now"))
            self.link.settle()
            self.assertEqual((later.state, later.scheduled_ns, self.ids()), ("sent", 9000, ["now"]))
            self.again()
            self.assertEqual((later.state, self.ids()), ("sent", ["now"]), "not before its time")
            self.link.answers += self.server.advance(9000)
            self.link.settle()
            self.assertEqual((later.state, self.ids()), ("accepted", ["later", "now"]))

    def test_a_timed_one_whose_time_passed_meanwhile_is_not_known(self) -> None:
        self.start(PlainServer(), on_disconnect="keep")
        later = self.commit(puts("l", "later"), present_at_ns=9000)
        now = self.commit(puts("l", "now"))
        self.link.settle()
        self.link.cut()
        self.server.advance(10_000)
        self.link.connect()
        self.link.settle()
        self.assertEqual((later.state, now.state, self.ids()), ("unknown", "accepted", ["now"]))
        with self.assertRaisesRegex(ConnectionError, "whether it was shown is not known"):
            later.wait(0)

    def test_the_owner_is_joined_again(self) -> None:
        self.start(PlainServer())
        self.commit(puts("l", "a"))
        self.link.settle()
        self.link.cut()
        self.server.sessions.clear()  # after more than 10 s
        self.again()
        self.assertEqual((self.server.session.owner, self.ids()), (1, ["a"]))  # type: ignore[union-attr]
        self.assertEqual((self.session.resumed, self.session.restored), (0, 1))

    def test_one_that_joined_another_outlives_the_server(self) -> None:
        first = PlainServer()
        first.begin()
        (opened,) = first.receive(pb.StreamRequest(open=pb.Open()).SerializeToString())
        self.start(first, owner_token=opened.opened.owner_token)
        self.commit(puts("l", "a"))
        self.link.settle()
        self.again(forget=True)
        self.assertEqual(self.ids(), ["a"])

    def test_a_wrong_owner_token_is_an_error(self) -> None:
        session = Session(Settings(owner_token=b"wrong"))
        session.open_request()
        self.assertFalse(session.forget_token())


class Outcomes(Case):
    def test_owed_ones_may_come_after_newer_commits(self) -> None:
        self.start(PlainServer(outcomes=False))
        old = self.commit(puts("l", "a"))
        self.link.settle()
        self.assertEqual((old.state, old.complete), ("accepted", False))
        self.link.cut()
        self.link.connect()
        self.link.settle()
        assert self.server.session is not None
        owed, self.server.session.owed = self.server.session.owed, []
        refused = self.commit(puts_of("l", "b", REFUSED))
        self.link.settle()
        self.assertEqual(refused.state, "accepted")
        self.link.answers += self.server.pay()
        self.link.settle()
        self.assertTrue(refused.complete)
        self.assertFalse(old.complete, "another's end says nothing of it")
        self.server.session.owed = owed
        self.link.answers += self.server.pay()
        self.link.settle()
        self.assertEqual(old.wait_shown(0)["d"].kind, "presented")

    def test_what_does_not_come_is_given_up_in_time(self) -> None:
        self.start(PlainServer(outcomes=False))
        old = self.commit(puts("l", "a"))
        self.link.settle()
        self.again()
        self.server.session.owed = []  # type: ignore[union-attr]
        self.assertFalse(old.complete)
        due = self.session.next_due_ns()
        assert due is not None
        self.session.next_request(due - 1)
        self.assertFalse(old.complete)
        self.session.next_request(due)
        self.assertLessEqual(due, self.link.now + OWED_NS)
        self.assertEqual({d: o.kind for d, o in old.wait_shown(0).items()}, {"d": "untold"})

    def test_a_server_that_forgot_will_not_tell(self) -> None:
        self.start(PlainServer(outcomes=False))
        old = self.commit(puts("l", "a"))
        self.link.settle()
        self.again(forget=True)
        self.assertIn("did not keep", old.wait_shown(0)["d"].reason)


class Issues(Case):
    def test_they_are_of_the_commit_with_their_sequence(self) -> None:
        self.start(PlainServer(window=1 << 20))
        first, second = self.commit(puts("l", "a")), self.commit(puts("l", "b"))
        timed = self.commit(puts_of("l", "c", REFUSED), present_at_ns=9000)
        third = self.commit(puts_of("l", "d", REFUSED))
        self.send_all()
        self.link.answers += self.server.advance(9000)
        answers, self.link.answers = self.link.answers, []
        # As if every issue were reported at once, and receipts later.
        for answer in answers:
            self.session.answer(pb.StreamResponse(issues=answer.issues), 0)
            del answer.issues[:]
        self.link.answers = answers
        self.link.settle()
        self.assertEqual([[i.id for i in f.issues] for f in (first, second, timed, third)], [[], [], ["c"], ["d"]])

    def test_one_that_must_be_shown_and_was_not_is_told_so(self) -> None:
        self.start(PlainServer(outcomes=False))
        must = self.commit(puts("l", "a"), must_show=True)
        self.link.settle()
        sequence = self.server.sequence
        after = self.commit(puts("l", "b"))
        self.send_all()
        self.session.answer(pb.StreamResponse(issues=[
            pb.Issue(sequence=sequence, field="commit.must_show", message="no outcome")]), 0)
        self.link.settle()
        self.assertEqual(([i.field for i in must.issues], after.issues), (["commit.must_show"], ()))


class TooLarge(Case):
    def test_it_is_refused_here(self) -> None:
        large = operations.define("o", [wire.message(shapes.pb.Object.Part())] * 2000)
        for connected in (True, False):
            self.start(PlainServer(max_message_bytes=1000))
            self.commit(puts("l", "before"))
            if not connected:
                self.session, self.link = Session(Settings()), None  # type: ignore[assignment]
                self.link = Wire(self.session, self.server)
            frame, after = self.commit(puts("l", "with it"), large), self.commit(puts("l", "after"))
            if not connected:
                self.assertEqual(frame.state, "waiting")
                self.link.connect()
            self.link.settle()
            self.assertEqual((frame.state, after.state), ("refused", "accepted"))
            self.assertNotIn("with it", self.ids())
            self.assertRegex(frame.reason, "[0-9]+ bytes and the server takes messages of at most 1000")
            self.assertTrue(self.session.idle())

    def test_a_frame_too(self) -> None:
        self.start(PlainServer(max_message_bytes=1000))
        frame = self.commit(operations.Immediate("l", [puts("l", "a", "b", size=10), puts("l", "c", size=2000)]))
        small = self.commit(operations.Immediate("l", [puts("l", *"abcdefghijkl", size=100)]))
        self.link.settle()
        self.assertEqual((frame.state, small.state, self.ids()), ("refused", "accepted", list("abcdefghijkl")))

    def test_of_the_scene_the_rest_is_put_up(self) -> None:
        self.start(PlainServer())
        self.commit(puts("l", "large", size=5000), puts("l", "small"))
        self.link.settle()
        self.server.limits.max_message_bytes = 1000
        self.again(forget=True)
        self.assertEqual(self.session.restored, 1)
        self.assertIn("max_message_bytes", self.issues[-1].message)
        self.assertEqual(self.ids(), ["small"])


if __name__ == "__main__":
    unittest.main()
