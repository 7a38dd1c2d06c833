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
        self.assertGreater(len(list(tree.imports())), 20, "the rules saw no sources of the viewer")
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

    def importing(self, rule, **sources):
        """Complaints about the viewer's files, each given as folder__name='import lines'."""
        for name, text in sources.items():
            self.write(f"client/web/src/{name.replace('__', '/')}.ts", text)
        found = self.complaints(rule)
        for name in sources:
            (self.root / f"client/web/src/{name.replace('__', '/')}.ts").unlink()
        return len(found)

    def test_arrows_between_folders_of_the_viewer(self):
        rule = house_rules.viewer_imports_follow_the_arrows
        for file, text in [
            ("protocol__a", "import { b } from '../document/b';"), ("document__a", "import type { B } from '../ui/b';"),
            ("view__light__a", "export { b } from '../scene/b';"), ("ui__a", "import '../app/app';"),
            ("editing__a", "import {\n  type B,\n} from '../looking/b';"), ("page__a", "const b = await import('../ui/b');"),
            ("view__looks__a", 'import { b } from "../../protocol/b";'), ("unruly__a", "import { b } from '../page/b';"),
            ("tiles__a", "new Worker(new URL('../ui/worker.ts', import.meta.url));"),
            ("protocol__a", "import { b } from 'src/ui/b';"), ("page__a", "import { b } from '../../../lib/b';"),
        ]:
            self.assertEqual(self.importing(rule, **{file: text}), 1, f"{file}: {text} must be refused")
        for file, text in [
            ("main", "import { App } from './app/app';"), ("protocol__a", "import { b } from './b';"),
            ("document__a", "import type { B } from '../protocol/b';"), ("view__viewer", "import { B } from './rays/b';"),
            ("app__a", "import { B } from '../ui/b';"), ("page__a", "import { Vector3 } from 'three';"),
        ]:
            self.assertEqual(self.importing(rule, **{file: text}), 0, f"{file}: {text} must be accepted")

    def test_circles_in_the_viewer(self):
        rule = house_rules.viewer_imports_make_no_circle
        self.assertEqual(self.importing(rule, ui__a="import { b } from './b';", ui__b="import { c } from './c';"), 0)
        self.assertEqual(self.importing(rule, ui__a="import { b } from './b';", ui__b="import type { A } from './a';"), 1)
        self.assertEqual(self.importing(
            rule, ui__a="import './b';", ui__b="import './c';", ui__c="export * from './d';", ui__d="import('./b');"), 1)
        # Folders, of whose files none imports itself again.
        self.assertEqual(self.importing(rule, ui__a="import '../page/b';", page__c="import '../ui/d';"), 1)

    def test_size_of_classes_in_the_viewer(self):
        rule = house_rules.viewer_classes_are_small

        def count(methods, members, parameters=0):
            lines = [f"  private readonly member{i} = 1;" for i in range(members)]
            lines += ["  constructor(", *(f"    private readonly p{i}: A," for i in range(parameters)), "  ) {}"]
            lines += [f"  async method{i}<T>(a: A): void {{\n    call(a);\n  }}" for i in range(methods)]
            return self.importing(rule, ui__a="export class A implements B {\n" + "\n".join(lines) + "\n}\n")

        self.assertEqual(count(house_rules.MAX_METHODS, house_rules.MAX_MEMBERS), 0)
        self.assertEqual(count(house_rules.MAX_METHODS + 1, 0), 1)
        self.assertEqual(count(0, house_rules.MAX_MEMBERS + 1), 1)
        self.assertEqual(count(0, house_rules.MAX_MEMBERS, 1), 1)
        body = "".join(f"  member{i} = 1;\n" for i in range(house_rules.MAX_MEMBERS + 1))
        self.assertEqual(self.importing(rule, ui__a="export class A\n  extends B\n  implements C\n{\n" + body + "}\n"), 1)

    def test_homes_of_libraries(self):
        def count(file, header):
            return self.including(house_rules.libraries_stay_at_home, file, f"<{header}>")

        for file, header in [
            ("server/solver/a.cpp", "epoxy/gl.h"), ("server/engine/a.cpp", "EGL/egl.h"), ("common/a.h", "GL/gl.h"),
            ("server/engine/a.cpp", "boost/asio.hpp"), ("client/cli/a.cpp", "boost/beast.hpp"),
            ("protocol/a.h", "boost/crc.hpp"), ("server/engine/a.cpp", "nlohmann/json.hpp"),
            ("server/net/a.cpp", "nlohmann/json.hpp"), ("common/a.h", "nlohmann/json_fwd.hpp"),
            ("server/solver/a.cpp", "gtest/gtest.h"), ("server/gpu/a.cpp", "embree3/rtcore.h"),
            ("server/scene/import/a.cpp", "draco/mesh/mesh.h"), ("server/scene/document/a.cpp", "meshoptimizer.h"),
            ("server/scene/import/a.cpp", "webp/decode.h"),
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
