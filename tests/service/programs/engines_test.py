"""Folders for engines: what goes wrong is told in a line, and leaves nothing half written."""
import json
import os
import subprocess
import unittest

from harness import ServiceCase, program


class Engines(ServiceCase):
    def solve(self, folder, engine):
        return subprocess.run([program("RADIOSITY"), "solve", os.environ["RADIOSITY_ROOM"], "-o", str(folder), "--for", engine, "--quiet", "--uniform",
                               "--error", "0.2", "--texels", "4000"], capture_output=True, text=True, timeout=300, check=False)

    def test_unknown_names_list_those_that_are_known(self):
        done = self.solve(self.folder / "out", "unity3d")
        self.assertEqual(done.returncode, 2)
        for name in ("unity3d", "three", "babylon", "playcanvas", "blender"):
            self.assertIn(name, done.stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_files_of_others_in_the_folder_stay(self):
        out = self.folder / "out"
        out.mkdir()
        (out / "mine.txt").write_text("mine")
        (out / "scene.glb").write_text("old")
        done = self.solve(out, "three")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((out / "mine.txt").read_text(), "mine")
        self.assertEqual((out / "scene.glb").read_bytes()[:4], b"glTF")
        self.assertEqual([path for path in out.iterdir() if path.name.startswith(".")], [])

    def test_states_what_the_encoding_loses_beside_the_error(self):
        out = self.folder / "out"
        done = self.solve(out, "playcanvas")
        self.assertEqual(done.returncode, 0, done.stderr)
        error = json.loads((out / "lighting.json").read_text())["error"]
        self.assertGreater(error["encoding"], 1e-5)
        self.assertLess(error["encoding"], 2 ** -11)  # half a step of halves
        self.assertGreater(error["total"], error["encoding"])
        self.assertIn("half-float DDS loses", done.stderr)

    def test_a_full_disk_leaves_nothing(self):
        disk = self.folder / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], check=False, capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("only root can mount a small disk")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        done = self.solve(disk / "out", "three")
        self.assertEqual(done.returncode, 1)
        complaints = [line for line in done.stderr.splitlines() if "error:" in line]
        self.assertEqual(len(complaints), 1, done.stderr)
        self.assertIn("no space left on the disk", complaints[0])
        self.assertEqual(list(disk.iterdir()), [])

    def test_a_file_in_place_of_the_folder(self):
        out = self.folder / "out"
        out.write_text("mine")
        done = self.solve(out, "three")
        self.assertEqual(done.returncode, 2)
        self.assertIn("this is a file", done.stderr)
        self.assertEqual(out.read_text(), "mine")


if __name__ == "__main__":
    unittest.main()
