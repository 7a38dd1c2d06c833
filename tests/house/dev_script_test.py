"""The first things a newcomer types at ./dev, as far as they need neither a build nor an installation."""

import subprocess
import tempfile
import unittest
from pathlib import Path

DEV = Path(__file__).resolve().parents[2] / "dev"


def dev(*arguments, cwd=None):
    return subprocess.run([DEV, *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL, cwd=cwd, timeout=60)


class Dev(unittest.TestCase):
    def test_help_goes_to_stdout_and_succeeds(self):
        for spelling in ("--help", "-h", "help"):
            done = dev(spelling)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            for command in ("run", "test", "build", "bench", "format", "lint", "clean"):
                self.assertRegex(done.stdout, rf"\n  {command} ")

    def test_an_unknown_command_is_named_and_fails_with_the_help(self):
        done = dev("bulid")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn('"bulid"', done.stderr)
        self.assertIn("Usage:", done.stderr)

    def test_no_command_fails_with_the_help(self):
        done = dev()
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("Usage:", done.stderr)

    def test_a_missing_scene_is_refused_before_anything_is_built(self):
        done = dev("run", "no-such-scene.glb")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("no-such-scene.glb", done.stderr)
        self.assertNotIn("building", done.stderr)

    def test_works_from_any_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(dev("--help", cwd=folder).returncode, 0)


if __name__ == "__main__":
    unittest.main()
