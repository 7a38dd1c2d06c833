import json
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import rates_table  # noqa: E402


class Figures(unittest.TestCase):
    def test_three_digits_with_the_letter_of_their_thousands(self):
        for value, text in ((12345678, "12.3 M"), (999, "999"), (0.01234, "0.0123"), (-2.5e9, "-2.5 G"), (0, "0")):
            self.assertEqual(rates_table.figure(value), text)

    def test_durations_choose_their_unit(self):
        for value, text in ((1.5, "1.5 s"), (0.0025, "2.5 ms"), (2.5e-6, "2.5 us"), (3e-9, "3 ns")):
            self.assertEqual(rates_table.duration(value), text)


class Tables(unittest.TestCase):
    row = {"name": "draw/scene:1/process_time/real_time", "label": "room_small", "time_unit": "us", "real_time": 250.0,
           "cpu_time": 500.0, "iterations": 7, "samples/s": 3e8}

    def written(self, **files):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in files.items():
                Path(folder, name + ".json").write_text(text)
            rates_table.main(Path(folder))
            result = Path(folder, "rates.md")
            return result.read_text() if result.exists() else None

    def test_a_row_has_name_label_times_and_our_counters_only(self):
        text = self.written(a_benchmark=json.dumps({"context": {"num_cpus": 2}, "benchmarks": [self.row]}))
        self.assertIn("| draw/scene:1 | room_small | 250 us | 500 us | samples/s 300 M |", text)

    def test_a_failed_row_says_why(self):
        failed = {"name": "draw", "error_occurred": True, "error_message": "no OpenGL"}
        text = self.written(a_benchmark=json.dumps({"context": {"num_cpus": 2}, "benchmarks": [failed]}))
        self.assertIn("failed: no OpenGL", text)

    def test_a_result_cut_short_does_not_hide_the_others(self):
        good = json.dumps({"context": {"num_cpus": 2}, "benchmarks": [self.row]})
        text = self.written(a_benchmark=good[:40], b_benchmark=good)
        self.assertIn("Not readable", text)
        self.assertIn("| draw/scene:1 |", text)

    def test_without_results_nothing_is_written(self):
        self.assertIsNone(self.written(other="{}"))


if __name__ == "__main__":
    unittest.main()
