"""`radiosity probes` and `solve --probes-out`: files of either ending, and what is wrong, said in one line."""
import json
import struct
import unittest

import plates
from harness import ServiceCase

QUICK = ("--error", 0.05, "--texels", 2000)
NUMBERS = 69


def head_of_bytes(data):
    magic, version, size = struct.unpack_from("<4sII", data)
    assert (magic, version) == (b"RPRB", 1)
    return json.loads(data[12:12 + size]), struct.unpack(f"<{(len(data) - 12 - size) // 4}f", data[12 + size:])


class ProbesTest(ServiceCase):
    def setUp(self):
        super().setUp()
        plates.write_glb(self.folder / "plates.glb", plates.lit_document())

    def test_solveWritesThemInEitherForm(self):
        for name in ("p.json", "p.bin"):
            out, _ = self.client("solve", "plates.glb", "-o", "lit.glb", "--probes", 0.3, "--probes-out", name, *QUICK)
            self.assertIn("the whole scene: ", out)
        told = json.loads((self.folder / "p.json").read_text())
        head, values = head_of_bytes((self.folder / "p.bin").read_bytes())
        grid, places = told["grids"][0], head["grids"][0]
        self.assertEqual(grid["counts"], places["counts"])
        count = grid["counts"][0] * grid["counts"][1] * grid["counts"][2]
        self.assertEqual(len(values), NUMBERS * count)
        self.assertEqual(len(grid["light"]), 27 * count)
        self.assertEqual(told["measured"], [grid["ring"].count(0)])
        self.assertTrue(any(light > 0 for light in grid["light"]))

    def test_asksAServerAsItIs(self):
        server = self.server()
        self.client("solve", "plates.glb", "-o", "lit.glb", "--server", server.url, *QUICK)
        out, _ = self.client("probes", server.url, "--spacing", 0.3, "-o", "p.bin")
        self.assertIn("p.bin\nthe whole scene: ", out)
        self.assertEqual(head_of_bytes((self.folder / "p.bin").read_bytes())[0]["state"], "converged")
        self.assertIn("radiosityProbes", self.complaint("probes", server.url, "-o", "p.json"))
        self.assertIn("would do", self.complaint("probes", server.url, "--spacing", 0.0001, "-o", "p.json"))

    def test_replaceNoFileThatIsReadOrWrittenBesideThem(self):
        gltf = self.folder / "scene.gltf"
        gltf.write_text(json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": "scene.bin", "byteLength": 4}]}))
        (self.folder / "scene.bin").write_bytes(b"1234")
        solve = ("solve", "scene.gltf", "-o", "lit.glb", "--probes", 0.3)
        self.assertIn("would replace", self.complaint(*solve, "--probes-out", "scene.bin"))
        self.assertIn("would replace", self.complaint(*solve, "--probes-out", "r.json", "--report", "r.json"))
        self.assertEqual((self.folder / "scene.bin").read_bytes(), b"1234")


if __name__ == "__main__":
    unittest.main()
