import random
import unittest

from voxeld.clock import DRIFT, KEPT, ClockEstimate


class Clock(unittest.TestCase):
    def test_the_true_offset_is_within_the_error(self) -> None:
        rng = random.Random(1)
        for _ in range(300):
            clock, offset = ClockEstimate(), rng.randrange(-(10**15), 10**15)
            drift = rng.uniform(-0.9, 0.9) * DRIFT
            start = now = rng.randrange(10**12)

            def server(client: int) -> int:
                return client + offset + int(drift * (client - start))

            self.assertIsNone(clock.offset_ns(now))
            for _ in range(rng.randrange(1, 3 * KEPT)):
                sent = now + rng.randrange(10**9)
                received = sent + rng.choice([0, 10**3, rng.randrange(10**8)])
                answered = received + rng.randrange(10**6)
                now = answered + rng.choice([0, 10**3, rng.randrange(10**8)])
                clock.add(sent, server(received), server(answered), now)
                for later in (now, now + 10**9, now + 10**11):
                    estimate, error = clock.offset_ns(later), clock.error_ns(later)
                    assert estimate is not None and error is not None
                    self.assertLessEqual(abs(estimate - (server(later) - later)), error + 2)

    def test_the_fastest_of_the_last_counts(self) -> None:
        clock = ClockEstimate()
        clock.add(0, 1000 + 500_000, 1000 + 500_000, 1_000_000)
        clock.add(2_000_000, 2_000_000 + 1000 + 5, 2_000_000 + 1000 + 5, 2_000_010)
        clock.add(3_000_000, 3_000_000 + 1000 + 300_000, 3_000_000 + 1000 + 300_000, 3_400_000)
        self.assertEqual(clock.offset_ns(3_400_000), 1000)

    def test_impossible_times_are_passed_over(self) -> None:
        clock = ClockEstimate()
        clock.add(100, 50, 40, 200)    # answered before it was received
        clock.add(100, 50, 350, 200)   # took longer at the server than in total
        self.assertFalse(clock.known())


if __name__ == "__main__":
    unittest.main()
