import concurrent.futures
import random
import threading
import unittest

from voxeld import CommitDropped, CommitRefused, ConnectionLost, NotDurable, receipts
from voxeld.receipts import Book, Frame, Issue, Stages
from voxeld.v1 import scene_pb2 as pb
from voxeld.v1 import types_pb2


def outcome(frame_id: int, display: str, rng: random.Random) -> pb.Receipt:
    kinds = [pb.Outcome(display=display, presented=pb.Presented(volume=3, time_ns=9, evidence=pb.EVIDENCE_DEVICE)),
             pb.Outcome(display=display, unchanged=pb.Unchanged(volume=3)),
             pb.Outcome(display=display, superseded=pb.Superseded(by_frame_id=frame_id + 1)),
             pb.Outcome(display=display, lost=pb.Lost(reason="unplugged")),
             pb.Outcome(display=display, not_shown=pb.NotShown(why=pb.NotShown.BLANKED))]
    return pb.Receipt(frame_id=frame_id, outcome=rng.choice(kinds))


class Sums(unittest.TestCase):
    def test_every_commit_ends_once_and_the_sums_are_right(self) -> None:
        rng = random.Random(1)
        for _ in range(100):
            book, frames, owed = Book(), [], []
            for number in range(1, 30):
                frames.append(Frame(number))
                book.add(frames[-1])
                ending = rng.random()
                if ending < 0.1:
                    book.drop(frames[-1], "policy")
                elif ending < 0.2:
                    owed.append([pb.Receipt(frame_id=number, refused=pb.Refused(message="no", refused_operations=2))])
                else:
                    displays = rng.sample("abc", rng.randrange(4))
                    accepted = pb.Accepted(displays=displays, refused_operations=1, dropped_frames=1)
                    rest = [outcome(number, d, rng) for d in displays]
                    rng.shuffle(rest)
                    owed.append([pb.Receipt(frame_id=number, accepted=accepted), *rest])
            given: list[pb.Receipt] = []
            while owed:
                mine = rng.choice(owed)
                given.append(mine.pop(0))
                book.receipt(given[-1])
                owed = [o for o in owed if o]
            self.assertTrue(all(f.complete and f.answered for f in frames))
            self.assertEqual(len(book), 0)
            c = book.counts
            self.assertEqual(c["commits"], 29)
            self.assertEqual(c["accepted"] + c["refused"] + c["dropped"], 29)
            kinds = [r.outcome.WhichOneof("what") for r in given if r.HasField("outcome")]
            for kind in ("presented", "unchanged", "superseded", "lost", "not_shown"):
                self.assertEqual(c[kind], kinds.count(kind))
            self.assertEqual(c["refused_operations"], c["accepted"] + 2 * c["refused"])
            self.assertEqual(c["server_drops"], c["accepted"])
            for frame in frames:
                self.assertEqual(frame.accepted is not None, frame.state == "accepted")
                if frame.accepted is not None:
                    self.assertEqual(set(frame.outcomes), set(frame.accepted.displays))

    def test_only_owed_outcomes_are_given_up_for_being_many(self) -> None:
        book = Book()
        frames = [Frame(number) for number in range(1, receipts.MAX_OWED + 100)]
        for frame in frames:
            book.add(frame)
        self.assertEqual({f.state for f in frames}, {"waiting"}, "what waits to be sent is bounded by its bytes")
        for frame in frames:
            book.receipt(pb.Receipt(frame_id=frame.id, accepted=pb.Accepted(displays=["d"])))
        self.assertEqual(len(book), receipts.MAX_OWED)
        self.assertEqual((frames[0].state, frames[0].outcomes["d"].kind), ("accepted", "untold"))
        self.assertEqual(frames[-1].outcomes, {})


class Waiting(unittest.TestCase):
    def test_issues_are_told_with_the_refusal(self) -> None:
        book, first = Book(), Frame(1)
        book.add(first)
        issue = Issue.of(pb.Issue(layer="l", id="i", field="upsert.entity", reason=types_pb2.REASON_INVALID_VALUE,
                                  message="is NaN"))
        book.receipt(pb.Receipt(frame_id=1, refused=pb.Refused(message="strict")), [issue])
        self.assertEqual([str(i) for i in first.issues], ["l/i: upsert.entity is NaN (invalid_value)"])
        with self.assertRaisesRegex(CommitRefused, "strict.*NaN") as caught:
            first.wait(0)
        self.assertEqual(caught.exception.issues, first.issues)
        second = Frame(2)
        book.add(second)
        whole = "strict; the first: l/i, upsert.entity: is NaN"
        book.receipt(pb.Receipt(frame_id=2, refused=pb.Refused(message=whole)), [issue])
        with self.assertRaises(CommitRefused) as again:
            second.wait(0)
        self.assertEqual(str(again.exception), whole, "said once")

    def test_each_of_several_that_have_the_same_fault_is_named(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        issues = [Issue.of(pb.Issue(layer="l", id=name, field="upsert.entity", reason=types_pb2.REASON_INVALID_VALUE,
                                    message="is NaN")) for name in ("i", "j", "k")]
        whole = "strict; the first: l/i, upsert.entity: is NaN"
        book.receipt(pb.Receipt(frame_id=1, refused=pb.Refused(message=whole)), issues)
        with self.assertRaises(CommitRefused) as caught:
            frame.wait(0)
        self.assertEqual(str(caught.exception), whole + "; l/j: upsert.entity is NaN (invalid_value); "
                                                        "l/k: upsert.entity is NaN (invalid_value)")

    def test_what_is_wrong_with_the_commit_itself_is_told_once(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        issue = Issue.of(pb.Issue(field="commit.present_at_ns", reason=types_pb2.REASON_QUOTA_EXCEEDED, message="too many wait"))
        whole = "nothing of the commit was applied: too many wait"
        book.receipt(pb.Receipt(frame_id=1, refused=pb.Refused(message=whole)), [issue])
        with self.assertRaises(CommitRefused) as caught:
            frame.wait(0)
        self.assertEqual(str(caught.exception), whole)

    def test_a_commit_that_is_carried_out_and_not_kept_is_not_called_refused(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        issue = Issue.of(pb.Issue(field="commit.durable", message="durable is true, and this server keeps nothing", applied=True))
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted(displays=["d"])), [issue])
        self.assertIs(frame.wait(0), frame)
        with self.assertRaisesRegex(NotDurable, "was carried out.*this server keeps nothing") as caught:
            frame.wait_durable(0)
        self.assertEqual(caught.exception.issues, (issue,))
        self.assertNotIsInstance(caught.exception, CommitRefused)

    def test_what_durable_waits_for_is_named(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted(durable=True)))
        with self.assertRaisesRegex(TimeoutError, "frame 1 is accepted and word that it is on the server's disk has not come in 0 s"):
            frame.wait_durable(0)

    def test_words_of_newer_servers_are_borne(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        why = pb.Receipt(frame_id=1, outcome=pb.Outcome(display="d"))
        why.outcome.not_shown.ParseFromString(b"\x08\x63")  # an unknown value of Why
        book.receipt(why)
        book.receipt(pb.Receipt(frame_id=1, outcome=pb.Outcome(display="e")))
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted(displays=["d", "e"])))
        self.assertEqual({d: (o.kind, o.reason[:13]) for d, o in frame.wait_shown(0).items()},
                         {"d": ("not_shown", "99"), "e": ("untold", "the server is")})

    def test_others_futures_are_resolved_by_who_was_asked_to(self) -> None:
        asked: list[concurrent.futures.Future[Frame]] = []
        book, frame = Book(), Frame(1, done=lambda future, frame: asked.append(future))
        book.add(frame)
        future = frame.future()
        future.add_done_callback(lambda _: self.fail("called by the book"))
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted()))
        self.assertEqual(asked, [future])
        self.assertEqual(frame.wait(0), frame)

    def test_what_waits_is_told(self) -> None:
        book, frame = Book(), Frame(1)
        book.add(frame)
        results = []
        threads = [threading.Thread(target=lambda: results.append(frame.wait(60).id)),
                   threading.Thread(target=lambda: results.append(len(frame.wait_shown(60))))]
        for thread in threads:
            thread.start()
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted(displays=["d"])))
        threads[0].join(60)
        self.assertEqual(results, [1])
        book.receipt(outcome(1, "d", random.Random(1)))
        threads[1].join(60)
        self.assertEqual(results, [1, 1])

    def test_ends_are_raised(self) -> None:
        book = Book()
        dropped, lost, late = Frame(1), Frame(2), Frame(3)
        for frame in (dropped, lost, late):
            book.add(frame)
        book.drop(dropped, "newer came")
        book.receipt(pb.Receipt(frame_id=3, accepted=pb.Accepted(displays=["d", "e"])))
        with self.assertRaisesRegex(TimeoutError, "frame 3 is accepted and the outcome on d, e has not come in 0"):
            late.wait_shown(0)
        book.give_up(book.open_frames(), "gone")
        for frame, error in ((dropped, CommitDropped), (lost, ConnectionLost)):
            with self.assertRaises(error):
                frame.wait_shown(0)
        self.assertEqual({d: o.kind for d, o in late.wait_shown(0).items()}, {"d": "untold", "e": "untold"})
        self.assertFalse(late.seen)

    def test_without_outcomes_accepted_is_all(self) -> None:
        book, frame = Book(), Frame(1, wants_outcomes=False)
        book.add(frame)
        book.receipt(pb.Receipt(frame_id=1, accepted=pb.Accepted(displays=["d"])))
        self.assertTrue(frame.complete)


class Latency(unittest.TestCase):
    def test_stages_take_what_passed_since_the_one_before(self) -> None:
        stages = Stages.of(pb.Stages(sent_ns=1_000_000, received_ns=3_000_000, applied_ns=3_500_000, shown_ns=10_000_000))
        self.assertEqual(stages.durations_ms(), {"received": 2.0, "applied": 0.5, "shown": 6.5})
        self.assertEqual(stages.total_ms(), 9.0)
        self.assertIsNone(Stages(received_ns=1).total_ms())


class Words(unittest.TestCase):
    def test_an_outcome_is_a_line_at_a_prompt(self) -> None:
        frame = pb.Receipt(outcome=pb.Outcome(display="sim", presented=pb.Presented(
            volume=3, time_ns=9, stages=pb.Stages(received_ns=10**15, shown_ns=10**15 + 1)))).outcome
        for outcome, told in ((frame, "<Outcome on 'sim': presented, volume 3>"),
                              (pb.Outcome(display="a", unchanged=pb.Unchanged(volume=4)), "<Outcome on 'a': unchanged, volume 4>"),
                              (pb.Outcome(display="a", superseded=pb.Superseded(by_frame_id=5)), "<Outcome on 'a': superseded by frame 5>"),
                              (pb.Outcome(display="a", lost=pb.Lost(reason="unplugged")), "<Outcome on 'a': lost: unplugged>"),
                              (pb.Outcome(display="a", not_shown=pb.NotShown(why=pb.NotShown.BLANKED)), "<Outcome on 'a': not_shown: blanked>")):
            self.assertEqual(repr(receipts.Outcome.of(outcome)), told)


if __name__ == "__main__":
    unittest.main()
