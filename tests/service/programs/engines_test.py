"""Folders for engines: what goes wrong is told in a line, and leaves nothing half written."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time
import unittest

from harness import ServiceCase, program


class Engines(ServiceCase):
    def command(self, folder, engine, *options):
        return [program("RADIOSITY"), "solve", os.environ["RADIOSITY_ROOM"], "-o", str(folder), "--for", engine, "--uniform", "--error", "0.2",
                "--texels", "4000", *options]

    def solve(self, folder, engine, *options, environment=None):
        return subprocess.run(self.command(folder, engine, "--quiet", *options), capture_output=True, text=True, timeout=300, check=False, env=environment)

    def with_blender(self, script):
        """An environment in which Blender is this shell script."""
        folder = self.folder / "bin"
        folder.mkdir()
        blender = folder / "blender"
        blender.write_text("#!/bin/sh\n" + script)
        blender.chmod(0o755)
        return {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}

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
        out = self.folder / "a room"
        done = subprocess.run(self.command(out, "playcanvas"), capture_output=True, text=True, timeout=300, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        error = json.loads((out / "lighting.json").read_text())["error"]
        self.assertGreater(error["encoding"], 1e-5)
        self.assertLess(error["encoding"], 2 ** -11)  # half a step of halves
        self.assertGreater(error["total"], error["encoding"])
        lines = [line.rsplit("\r", 1)[-1].removeprefix("\x1b[K") for line in done.stderr.split("\n")]
        self.assertTrue(any(line.startswith("half-float DDS loses") for line in lines), done.stderr)
        self.assertIn(f"to see it in PlayCanvas: cd '{out}' && npm install && npm start", lines)
        self.assertNotIn("loses", self.solve(out, "playcanvas").stderr)

    def test_pages_of_the_user_stay_and_lightmaps_of_before_go(self):
        out = self.folder / "out"
        done = self.solve(out, "three")
        self.assertEqual(done.returncode, 0, done.stderr)
        about = json.loads((out / "lighting.json").read_text())
        for page in ("lightmap.7.exr", "../mine.exr"):
            (out / page).write_text("old")
            about["lightmaps"].append({"file": page})
        (out / "lighting.json").write_text(json.dumps(about))
        (out / "index.html").write_text("mine")
        (out / "page.js").unlink()
        done = self.solve(out, "babylon")  # whose lit_scene.js would replace that of three.js
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("index.html in", done.stderr)
        self.assertEqual((out / "index.html").read_text(), "mine")
        self.assertFalse((out / "page.js").exists())
        self.assertIn("three", (out / "lit_scene.js").read_text())
        self.assertEqual(json.loads((out / "lighting.json").read_text())["engine"], "babylon")
        self.assertFalse((out / "lightmap.7.exr").exists())
        self.assertTrue((self.folder / "mine.exr").exists())
        (out / "index.html").unlink()
        self.assertEqual(self.solve(out, "babylon").stderr.count("index.html"), 0)
        self.assertNotIn("three", (out / "lit_scene.js").read_text())

    def test_a_picture_in_the_folder_or_through_a_link(self):
        out = self.folder / "out"
        link = self.folder / "link.png"
        (self.folder / "picture.png").write_text("old")
        link.symlink_to(self.folder / "picture.png")
        for picture, file in ((out / "p.png", out / "p.png"), (link, self.folder / "picture.png")):
            done = self.solve(out, "three", "--png", str(picture))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(file.read_bytes()[1:4], b"PNG")
            self.assertIn(str(picture), done.stdout.splitlines())
            self.assertEqual(len(json.loads((out / "lighting.json").read_text())["lightmaps"]), len(list(out.glob("lightmap.*"))))

    def test_what_a_killed_program_left_is_swept(self):
        out = self.folder / "out"
        (out / ".radiosity-abcdef").mkdir(parents=True)
        (out / ".radiosity-abcdef" / "lit.glb").write_text("half")
        self.assertEqual(self.solve(out, "three").returncode, 0)
        self.assertEqual([path for path in out.iterdir() if path.name.startswith(".")], [])

    def test_a_solve_is_kept_whatever_blender_does(self):
        for number, (script, complaint) in enumerate((("echo 'ValueError: no luck'; exit 1", "ValueError: no luck"), ("exit 127", "status 127"),
                                                      ("kill -SEGV $$", "status 139"))):
            out = self.folder / f"out{number}"
            done = self.solve(out, "blender", environment=self.with_blender(script))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(complaint, done.stderr)
            self.assertEqual({path.name for path in out.iterdir()}, {"scene.glb", "lighting.json", "lightmap.0.exr", "make_blend.py"})
            shutil.rmtree(self.folder / "bin")

    def test_an_interruption_ends_blender_and_what_it_started(self):
        pids = self.folder / "pids"
        environment = self.with_blender(f"sleep 300 & echo $! $$ > {pids}.new; mv {pids}.new {pids}; wait")
        out = self.folder / "out"
        with subprocess.Popen(self.command(out, "blender", "--quiet"), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, env=environment) as running:
            end = time.monotonic() + 120
            while not pids.exists() and time.monotonic() < end:
                time.sleep(0.05)
            running.send_signal(signal.SIGTERM)
            running.communicate(timeout=30)
        self.assertEqual(running.returncode, 75)
        self.assertFalse(out.exists())
        for pid in pids.read_text().split():
            self.assertTrue(self.has_ended(int(pid)), pid)

    @staticmethod
    def has_ended(pid):
        for _ in range(100):
            try:
                state = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
            except OSError:
                return True
            if state == "Z":  # killed, though nobody has asked for it
                return True
            time.sleep(0.05)
        return False

    def test_a_full_disk_leaves_nothing(self):
        # Of inodes, the scene as it is on the server takes two, beside three folders; the files for three.js take seven.
        for number, limit in enumerate(("size=64k", "nr_inodes=7")):
            disk = self.folder / f"disk{number}"
            disk.mkdir()
            mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", limit, "tmpfs", disk], check=False, capture_output=True)
            if mounted.returncode != 0:
                self.skipTest("only root can mount a small disk")
            self.addCleanup(subprocess.run, ["umount", disk], check=True)
            done = self.solve(disk / "out", "three")
            self.assertEqual(done.returncode, 1)
            complaints = [line for line in done.stderr.splitlines() if "error:" in line]
            self.assertEqual(len(complaints), 1, done.stderr)
            self.assertIn("no space left on the disk", complaints[0])
            self.assertIn(f"{disk}/out/", complaints[0])
            self.assertEqual("lit.glb" in complaints[0], number == 0, complaints[0])
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
