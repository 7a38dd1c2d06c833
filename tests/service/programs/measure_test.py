"""`radiosity measure` and `solve --measure`: figures, files, and what is wrong, said in one line."""
import csv
import json
import unittest

import plates
from harness import ServiceCase

QUICK = ("--error", 0.05, "--texels", 2000)


def with_plane(scene, plane, y=0.001):
    """A plane over all of the floor, whose mean is that of the floor."""
    scene["scenes"][0]["nodes"].append(len(scene["nodes"]))
    scene["nodes"].append({"name": "desk", "translation": [0, y, 0], "extras": {"radiosityPlane": plane}})
    return scene


class MeasureTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.plane = {"width": 1, "depth": 1, "columns": 16, "rows": 16, "target": {"lux": 5, "uniformity": 0.5}}
        plates.write_glb(self.folder / "planes.glb", with_plane(plates.lit_document(), self.plane))

    def test_solvesASceneAndTellsItsPlanes(self):
        out, _ = self.client("measure", "planes.glb", "--csv", "p.csv", "--json", "p.json", *QUICK)
        self.assertIn("desk, 16 x 16 points: mean", out)
        self.assertIn("5 lux: passes; U0 0.5: passes; passes at 95 %", out)
        self.assertEqual(self.files(), ["p.csv", "p.json", "planes.glb"])
        plane = json.loads((self.folder / "p.json").read_text())["planes"][0]
        self.assertAlmostEqual(plane["mean"] / plates.FLOOR_MEAN_LUX, 1, delta=0.01)
        self.assertLess(plane["meanError"], 0.01 * plane["mean"])
        self.assertEqual(len(plane["lux"]), 256)
        self.assertEqual(plane["verdict"], {"lux": "passes", "uniformity": "passes", "all": "passes"})
        first, second = (self.folder / "p.csv").read_text().split("\n\n")  # read with CR LF as LF
        self.assertEqual(next(csv.DictReader(first.splitlines()))["verdict"], "passes")
        points = list(csv.DictReader(second.splitlines()))
        self.assertEqual([float(point["lux"]) for point in points], plane["lux"])
        self.assertEqual((points[17]["column"], points[17]["row"]), ("1", "1"))

    def test_solveWritesThemToo(self):
        out, _ = self.client("solve", "planes.glb", "-o", "lit.glb", "--measure", "p.csv", *QUICK)
        self.assertIn("desk, 16 x 16 points", out)
        self.assertEqual(self.files(), ["lit.glb", "lit.lightmap.0.exr", "p.csv", "planes.glb"])

    def test_asksAServerAsItIs(self):
        server = self.server()
        self.client("solve", "planes.glb", "-o", "lit.glb", "--server", server.url, *QUICK)
        low, _ = self.client("measure", "--server", server.url)
        node = len(plates.lit_document()["nodes"])
        self.client("move", server.url, "@desk", 0, 0.5, 0)
        high, _ = self.client("measure", "--server", server.url, "--plane", "desk", "--daylight-factor")
        mean = lambda text: float(text.split("mean ")[1].split()[0])
        self.assertGreater(mean(high), 1.5 * mean(low))
        self.assertIn("daylight factor: mean", high)
        self.assertIn("node of this number", self.complaint("measure", "--server", server.url, "--plane", node + 1))

    def test_whatIsWrongIsSaidInOneLine(self):
        plates.write_glb(self.folder / "none.glb", plates.lit_document())
        self.assertIn("extras.radiosityPlane", self.complaint("measure", "none.glb", *QUICK))
        # Nobody waits for light that is not asked for: an error of a millionth would take for ever.
        endless = ("--error", 0.000001)
        for command in (("measure", "none.glb"), ("solve", "none.glb", "-o", "lit.glb", "--measure", "p.csv")):
            self.assertIn("no measuring plane", self.complaint(*command, *endless))
        self.assertIn("of this name", self.complaint("measure", "planes.glb", "--plane", "shelf", *endless))
        self.assertEqual(self.files(), ["none.glb", "planes.glb"])
        for change, place in (({"width": 0}, "/width"), ({"columns": 10**9}, "/columns"), ({"target": 5}, "/target")):
            with self.subTest(place=place):
                scene = with_plane(plates.lit_document(), {**self.plane, **change})
                plates.write_glb(self.folder / "bad.glb", scene)
                self.assertIn(f"extras/radiosityPlane{place}", self.complaint("measure", "bad.glb"))
        self.assertIn("SCENE", self.complaint("measure"))


if __name__ == "__main__":
    unittest.main()
