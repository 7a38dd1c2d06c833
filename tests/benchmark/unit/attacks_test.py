"""The files of attacks.py are what they say, and it counts what it measures where that belongs."""
import sys
import unittest
import zlib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import attacks
import attack_scenes
import plates


class Scenes(unittest.TestCase):
    def test_all_have_the_lamp_that_is_edited(self):
        for make in (attack_scenes.instances_claimed, attack_scenes.accessor_bomb, lambda: attack_scenes.nodes_in_one_place(10),
                     lambda: attack_scenes.leaning_slabs(10), lambda: attack_scenes.leaning_tubes(10),
                     lambda: attack_scenes.cut_off_pictures(3, 16), lambda: attack_scenes.forty_pictures(16),
                     lambda: attack_scenes.many_nodes(10), lambda: attack_scenes.many_triangles(3),
                     lambda: attack_scenes.solid_webps(2, 16), lambda: attack_scenes.inflating_picture(16, 1_000_000),
                     attack_scenes.entries_of("materials"), lambda: attack_scenes.point_lights(10),
                     lambda: attack_scenes.shining_squares(10), lambda: attack_scenes.poses(10, 10)):
            glb = plates.Glb(make())
            lamps = [material for material in glb.json["materials"] if material.get("name") == "lamp"]
            self.assertEqual(len(lamps), 1)
            self.assertIn("KHR_materials_emissive_strength", lamps[0]["extensions"])
            self.assertEqual(glb.json["buffers"], [{"byteLength": len(glb.bin) - (-glb.json["buffers"][0]["byteLength"] % 4)}])

    def test_a_picture_inflates_far_beyond_its_pixels(self):
        glb = plates.Glb(attack_scenes.inflating_picture(16, 3_000_000))
        view = glb.json["bufferViews"][glb.json["images"][0]["bufferView"]]
        png = glb.bin[view["byteOffset"]:view["byteOffset"] + view["byteLength"]]
        length = int.from_bytes(png[33:37], "big")
        self.assertEqual(png[37:41], b"IDAT")
        self.assertEqual(len(zlib.decompress(png[41:41 + length])), 3_000_000)

    def test_what_fills_a_mebibyte_does(self):
        for name in ("nodes", "materials"):
            self.assertAlmostEqual(len(attack_scenes.entries_of(name)()), 1 << 20, delta=200)

    def test_cut_off_pictures_begin_in_one_place_and_end_before_its_end(self):
        glb = plates.Glb(attack_scenes.cut_off_pictures(3, 16))
        views = [glb.json["bufferViews"][image["bufferView"]] for image in glb.json["images"]]
        self.assertEqual(len({view["byteOffset"] for view in views}), 1)
        self.assertEqual(len({view["byteLength"] for view in views}), 3)


class Rows(unittest.TestCase):
    def test_what_is_never_answered_counts_as_long_as_it_was_waited_for(self):
        rows = [["edit", 1.0, None, ""], ["status", 1.0, None, ""], ["edit", 1.0, 0.5, ""], ["edit", 2.0, None, ""]]
        self.assertEqual(attacks.answered(rows, 5.0), [["edit", 1.0, 0.5, ""], ["edit", 2.0, 3.0, ""], ["status", 1.0, 4.0, ""]])


class Percentiles(unittest.TestCase):
    def test_are_of_milliseconds(self):
        self.assertEqual(attacks.percentiles([0.001 * i for i in range(1, 101)]), {"count": 100, "p50": 51.0, "p99": 100.0, "max": 100.0})

    def test_of_nothing_there_are_none(self):
        self.assertEqual(attacks.percentiles([]), {"count": 0, "p50": None, "p99": None, "max": None})


if __name__ == "__main__":
    unittest.main()
