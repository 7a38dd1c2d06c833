"""Checks this checkout against the rules of the house, and each rule against small trees that break it."""

import tempfile
import unittest
from pathlib import Path

import house_rules
from house_rules import Tree

ROOT = Path(__file__).resolve().parents[2]


class ThisCheckout(unittest.TestCase):
    def test_keeps_every_rule(self):
        tree = Tree(ROOT)
        self.assertGreater(len(list(tree.includes())), 20, "the rules saw no sources")
        for rule in house_rules.RULES:
            with self.subTest(rule=rule.__name__):
                broken = list(rule(tree))
                self.assertFalse(broken, "\n" + "\n".join(broken))


class EachRule(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)

    def write(self, file, text):
        path = self.root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def complaints(self, rule):
        return list(rule(Tree(self.root)))

    def including(self, rule, file, *headers):
        self.write(file, "".join(f"#include {header}\n" for header in headers))
        found = self.complaints(rule)
        (self.root / file).unlink()
        return len(found)

    def test_arrows_between_folders(self):
        def count(file, header):
            return self.including(house_rules.own_includes_follow_the_arrows, file, f'"{header}"')

        for file, header in [
            ("common/a.h", "server/scene/values/scene.h"), ("protocol/a.cpp", "server/engine/engine.h"),
            ("server/scene/charts/a.cpp", "server/solver/transport/wave.h"),
            ("server/scene/values/a.cpp", "protocol/codec.h"),
            ("server/scene/values/a.h", "server/scene/charts/charts.h"),
            ("server/scene/charts/a.h", "server/scene/import/a.h"),
            ("server/scene/a.cpp", "server/scene/values/scene.h"),
            ("server/geometry/a.cpp", "server/scene/values/scene.h"),
            ("server/solver/lamps/a.cpp", "server/scene/document/document.h"),
            ("server/solver/math/a.cpp", "server/gpu/picture/view_renderer.h"),
            ("server/solver/reflected/a.cpp", "server/solver/variation/leaf_variation.h"),
            ("server/gpu/draw/a.cpp", "server/gpu/gather/receivers.h"),
            ("server/gpu/gl/a.cpp", "server/scene/charts/build.h"),
            ("server/gpu/run/a.cpp", "server/engine/engine.h"), ("server/engine/loop/a.cpp", "protocol/messages.h"),
            ("server/engine/lit/a.cpp", "server/engine/loop/solve_loop.h"),
            ("server/engine/engine.h", "server/engine/lit/a.h"),
            ("server/engine/loop/a.cpp", "server/net/listener.h"),
            ("server/net/a.cpp", "server/engine/loop/solve_loop.h"),
            ("server/net/a.cpp", "server/scene/values/scene.h"), ("client/lib/a.cpp", "server/scene/values/scene.h"),
            ("client/lib/a.cpp", "client/cli/solve.h"), ("server/engine/loop/a.cpp", "tests/oracle/oracle.h"),
            ("server/main.cpp", "tests/oracle/oracle.h"), ("server/unruly/a.cpp", "common/result.h"),
            ("server/solver/math/a.cpp", "../scene/scene.h"), ("server/state/a.cpp", "server/scene/document/document.h"),
            ("server/state/a.cpp", "server/engine/engine.h"), ("server/net/a.cpp", "server/state/store.h"),
        ]:
            self.assertEqual(count(file, header), 1, f"{file} -> {header} must be refused")
        for file, header in [
            ("common/a.h", "common/result.h"), ("server/engine/persist/a.cpp", "server/state/store.h"),
            ("server/net/a.cpp", "server/state/uploads.h"),
            ("server/solver/math/a.cpp", "server/scene/values/patch_scene.h"),
            ("server/solver/pipeline/a.cpp", "server/solver/reflected/leaf_gather.h"),
            ("server/solver/shooting/a.h", "server/solver/solver.h"),
            ("server/scene/charts/a.cpp", "server/geometry/bvh.h"),
            ("server/gpu/gather/a.cpp", "server/solver/rays/leaf_rays.h"),
            ("server/net/a.cpp", "server/engine/engine.h"), ("server/main.cpp", "server/net/listener.h"),
            ("server/options.cpp", "server/engine/engine.h"), ("client/cli/a.cpp", "client/lib/connection.h"),
            ("tests/unit/solver/a_test.cpp", "server/solver/shooting/state.h"), ("tests/oracle/a.cpp", "tests/scenes/room.h"),
        ]:
            self.assertEqual(count(file, header), 0, f"{file} -> {header} must be accepted")

    def test_circles_of_folders(self):
        rule = house_rules.folders_form_no_circle
        self.write("server/a/a.h", '#include "server/b/b.h"\n#include "server/a/own.h"\n')
        self.write("server/a/own.h", "")
        self.write("server/b/b.h", '#include "server/c/c.h"\n')
        self.write("server/c/c.h", "")
        self.assertEqual(self.complaints(rule), [])
        self.write("server/c/c.h", '#include "server/a/own.h"\n')
        self.assertEqual(len(self.complaints(rule)), 3, "each step of the circle is told")

    def test_an_include_is_seen_however_it_is_written(self):
        rule = house_rules.own_includes_follow_the_arrows
        self.assertEqual(self.including(rule, "common/a.h", "<server/scene/values/scene.h>"), 1)
        self.write("common/b.h", '  #  include "server/scene/values/scene.h" // why\n')
        self.assertEqual(len(self.complaints(rule)), 1)
        self.write("common/b.h", '#include "c.h"\n')
        self.write("common/c.h", "")
        self.assertEqual(len(self.complaints(rule)), 1)

    def test_homes_of_libraries(self):
        def count(file, header):
            return self.including(house_rules.libraries_stay_at_home, file, f"<{header}>")

        for file, header in [
            ("server/solver/a.cpp", "epoxy/gl.h"), ("server/engine/a.cpp", "EGL/egl.h"), ("common/a.h", "GL/gl.h"),
            ("server/engine/a.cpp", "boost/asio.hpp"), ("client/cli/a.cpp", "boost/beast.hpp"),
            ("protocol/a.h", "boost/crc.hpp"), ("server/engine/a.cpp", "nlohmann/json.hpp"),
            ("server/net/a.cpp", "nlohmann/json.hpp"), ("common/a.h", "nlohmann/json_fwd.hpp"),
            ("server/solver/a.cpp", "gtest/gtest.h"), ("server/gpu/a.cpp", "embree3/rtcore.h"),
        ]:
            self.assertEqual(count(file, header), 1, f"{file} -> {header} must be refused")
        for file, header in [
            ("server/gpu/a.cpp", "epoxy/gl.h"), ("tests/gl/a.cpp", "EGL/egl.h"), ("server/net/a.cpp", "boost/beast.hpp"),
            ("server/main.cpp", "boost/asio.hpp"), ("client/lib/a.cpp", "boost/asio.hpp"),
            ("server/scene/a.cpp", "nlohmann/json.hpp"), ("tests/oracle/a.cpp", "embree3/rtcore.h"),
        ]:
            self.assertEqual(count(file, header), 0, f"{file} -> {header} must be accepted")

    def test_top_level(self):
        self.write("README.md", "")
        self.write("server/main.cpp", "")
        self.assertEqual(self.complaints(house_rules.top_level_is_fixed), [])
        self.write("notes/a.md", "")
        self.write("setup.py", "")
        self.assertEqual(len(self.complaints(house_rules.top_level_is_fixed)), 2)

    def test_length(self):
        self.write("common/a.h", "\n" * house_rules.MAX_LINES)
        self.assertEqual(self.complaints(house_rules.files_are_short), [])
        self.write("common/a.h", "\n" * (house_rules.MAX_LINES + 1))
        self.assertEqual(len(self.complaints(house_rules.files_are_short)), 1)

    def test_leftovers(self):
        self.write("common/a.h", "// the method of todos and hacks that were never made\n")
        self.assertEqual(self.complaints(house_rules.nothing_is_left_over), [])
        self.write("common/a.h", "// TO" + "DO: finish\nint a;  // FIX" + "ME\n")
        self.assertEqual(len(self.complaints(house_rules.nothing_is_left_over)), 2)

    def test_clones(self):
        clones = '__attribute__((target_clones("avx2", "default")))'
        self.write("common/clones.h", f"#define RADIOSITY_CLONES {clones}\n")
        self.write("server/solver/a.cpp", "RADIOSITY_CLONES float a();\n")
        self.assertEqual(self.complaints(house_rules.clones_are_made_in_one_way), [])
        self.write("server/solver/a.cpp", f"{clones} float a();\n")
        self.assertEqual(len(self.complaints(house_rules.clones_are_made_in_one_way)), 1)

    def test_what_clang_refuses(self):
        self.write("server/a.cpp", "std::ranges::sort(a);  // std::ranges::unique(a)\nstd::unique(a.begin(), a.end());\n")
        self.assertEqual(self.complaints(house_rules.clang_14_can_compile_it), [])
        self.write("server/a.cpp", "std::ranges::unique(a);\nfor (auto b : a | std::views::reverse) c(b);\n")
        self.assertEqual(len(self.complaints(house_rules.clang_14_can_compile_it)), 2)

    def test_machine_paths(self):
        self.write("README.md", "at/home/a, ~/home/a, ../home/b, $HOME/home/c, https://example.org/home/\n")
        self.assertEqual(self.complaints(house_rules.no_machine_is_named), [])
        self.write("README.md", "see /ho" + "me/ada/scene.glb\nand \"/ro" + "ot/scenes\"\n")
        self.assertEqual(len(self.complaints(house_rules.no_machine_is_named)), 2)

    def test_packages(self):
        self.write("dev", "packages=(\n  cmake g++\n)\nlint_packages=(clang)\n")
        self.write("README.md", "# a\n\n## Dependencies\n\n| `cmake` | why |\n| `clang` | why |\n| `g++` | why |\n\n## b\n`other`\n")
        self.assertEqual(self.complaints(house_rules.readme_explains_every_package), [])
        self.write("README.md", "# a\n\n## Dependencies\n\n| `cmake` | why |\n| `g++` | why |\n| `tool` | why |\n")
        self.assertEqual(len(self.complaints(house_rules.readme_explains_every_package)), 2)

    def test_build_outputs_are_not_judged(self):
        self.write("build/common/a.h", "\n" * 1000)
        self.write("tests/web/node_modules/a/b.js", "\n" * 1000)
        self.assertEqual(Tree(self.root).files, [])


if __name__ == "__main__":
    unittest.main()
