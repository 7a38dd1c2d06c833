"""What soak.py takes for growth, and what it does not."""

import random
import sys
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import soak
import soak_load


def samples(memory, descriptors=lambda n: 15):
    return [{"server": {"memory_mib": memory(n), "descriptors": descriptors(n), "threads": 8}} for n in range(soak.ROUNDS)]


def grown(rows):
    return {what for _, what, _, _, growth, bound in soak.judged(rows) if growth > bound}


class Growth(unittest.TestCase):
    def test_a_pool_that_fills_at_first_and_an_allocator_that_wavers_are_none(self):
        dice = random.Random(1)
        self.assertEqual(grown(samples(lambda n: min(60, 30 + 8 * n) + dice.uniform(-3, 3))), set())

    def test_the_least_that_can_be_forgotten_in_each_of_a_million_edits_is(self):
        each_round = 32 * 1_000_000 / soak.ROUNDS / soak.MIB
        self.assertEqual(grown(samples(lambda n: 40 + n * each_round)), {"memory_mib"})

    def test_a_single_descriptor_is(self):
        self.assertEqual(grown(samples(lambda n: 40, lambda n: 15 if n < 12 else 16)), {"descriptors"})

    def test_one_high_sample_is_none(self):
        self.assertEqual(grown(samples(lambda n: 90 if n == soak.ROUNDS - 1 else 40)), set())


class Writers(unittest.TestCase):
    def test_one_who_finds_all_edits_made_does_nothing(self):
        writer = soak_load.Writer(0, 0)  # nobody listens there
        writer.work(soak_load.Quota(0, 0))
        self.assertEqual(writer.count, 0)

    def test_one_whom_nobody_lets_in_tries_again_later(self):
        writer = soak_load.Writer(0, 0)
        self.assertFalse(writer.made([writer.edit()]))


if __name__ == "__main__":
    unittest.main()
