"""The scripts in client/examples, word for word, as a user would start them."""
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

from harness import MARK, ServiceCase
from patience import PATIENCE
from pictures import brightness

EXAMPLES = pathlib.Path(__file__).resolve().parents[3] / "client" / "examples"
ROOM = os.environ.get("RADIOSITY_ROOM", "")
# The scene of `./dev run`: the names that the scripts begin with are in it.
CORNELL = str(pathlib.Path(ROOM).with_name("cornell.glb"))
NODE_MODULES = "/usr/share/nodejs"  # where Debian installs node-ws; nodejs of another origin does not look there
LAMP, CHAIR = "lamp_light", "chair1"


class ExamplesTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.serve(ROOM)

    def serve(self, scene):
        self.running = self.server(scene, "--texels", 3000)
        self.address = self.running.url.removeprefix("http://")

    def example(self, name, *arguments):
        program = [sys.executable] if name.endswith(".py") else [shutil.which("node")]
        if program[0] is None:
            self.skipTest("no node here (package nodejs)")
        done = subprocess.run([*program, EXAMPLES / name, self.address, *arguments], cwd=self.folder, timeout=400 * PATIENCE,
                              env={**os.environ, MARK: self.mark, "NODE_PATH": NODE_MODULES}, capture_output=True,
                              text=True, check=False)
        if "Cannot find module 'ws'" in done.stderr:
            self.skipTest("node has no module ws here (package node-ws)")
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()

    def expectPictures(self, names, count):
        self.assertEqual(len(names), count)
        pictures = [(self.folder / name).read_bytes() for name in names]
        for picture in pictures:
            self.assertEqual(picture[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(len(set(pictures)), count)
        return pictures

    def expectDarkerAndDarker(self, pictures):
        """As the lamp gets: were each exposed for its own light, all would be alike."""
        seen = [brightness(picture) for picture in pictures[::4]]
        self.assertEqual(seen, sorted(seen, reverse=True))
        self.assertGreater(seen[0], 2 * seen[-1])

    def test_lampSweepInPython(self):
        self.expectPictures(self.example("sweep_lamp.py", LAMP), 20)

    def test_lampSweepInNode(self):
        self.expectDarkerAndDarker(self.expectPictures(self.example("sweep_lamp.js", LAMP), 20))

    def test_timeLapseInPython(self):
        self.expectPictures(self.example("time_lapse.py", CHAIR, "6"), 6)

    def test_timeLapseInNode(self):
        self.expectPictures(self.example("time_lapse.js", CHAIR, "6"), 6)

    def test_lampSweepAsAScript(self):
        text = (EXAMPLES / "sweep_lamp.txt").read_text().replace("@light.", f"@{LAMP}.")
        self.client("script", self.running.url, "-", stdin=text)
        self.expectDarkerAndDarker(self.expectPictures([f"sweep-{i:02}.png" for i in range(20)], 20))

    def test_withoutArgumentsTheyServeTheCornellBox(self):
        self.serve(CORNELL)
        self.expectPictures(self.example("sweep_lamp.py"), 20)
        self.expectPictures(self.example("time_lapse.py"), 24)
        self.expectPictures(self.example("sweep_lamp.js"), 20)
        self.expectPictures(self.example("time_lapse.js"), 24)
        self.client("script", self.running.url, EXAMPLES / "sweep_lamp.txt")

    def test_mistakesAreSaidInOneLine(self):
        for name, complaint in (("sweep_lamp.py", "nothing is named 'nobody'"), ("time_lapse.py", "no node is named 'nobody'")):
            done = subprocess.run([sys.executable, EXAMPLES / name, self.address, "nobody"], cwd=self.folder,
                                  timeout=60, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 1)
            self.assertIn(complaint, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)


if __name__ == "__main__":
    unittest.main()
