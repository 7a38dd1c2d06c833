"""What ./dev does with what is typed, as far as it needs neither a build nor an installation: those are played by
stand-ins."""

import json
import os
import shutil
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

    def test_options_of_a_benchmark_need_its_name_before_them(self):
        done = dev("bench", "--full", "--times=1")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("./dev bench error_time --times=1", done.stderr)
        self.assertNotIn("building", done.stderr)

    def test_works_from_any_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(dev("--help", cwd=folder).returncode, 0)


class Checkout(unittest.TestCase):
    """A copy of `dev` where all packages are installed and programs may be played by stand-ins."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name).resolve()
        shutil.copy(DEV, self.root / "dev")
        self.stand_in("bin/dpkg-query", 'for name; do echo "ii $name"; done')

    def stand_in(self, name, script):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!/bin/bash\n{script}\n")
        path.chmod(0o755)


class DevRun(Checkout):
    """`./dev run` in a checkout that is built already; the two programs tell how they were called."""

    def setUp(self):
        super().setUp()
        self.stand_in("bin/ninja", 'echo "ninja: no work to do."')
        self.stand_in("build/client/cli/radiosity", 'printf "client|%s" "$@"; exit "${SOLVE_STATUS:-0}"')
        self.stand_in("build/server/radiosityd", 'printf "server|%s" "$@"')
        (self.root / "build/build.ninja").touch()
        (self.root / "my room.glb").touch()

    def run_dev(self, *arguments, solve_status=0, cwd=None, listen=""):
        environment = dict(os.environ, PATH=f"{self.root}/bin:{os.environ['PATH']}", SOLVE_STATUS=str(solve_status),
                           RADIOSITY_LISTEN=listen)
        return subprocess.run([self.root / "dev", "run", *arguments], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL, cwd=cwd or self.root, env=environment)

    def test_a_built_tree_is_run_without_a_word(self):
        done = self.run_dev("--no-serve")
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_the_default_scene_is_the_cornell_box(self):
        called = self.run_dev("--no-serve").stdout.split("client|")
        self.assertEqual(called, ["", "solve", f"{self.root}/build/scenes/cornell.glb", "-o", "out/cornell-lit.glb",
                                  "--png", "out/cornell.png", "--report", "out/cornell.json"])

    def test_a_scene_with_a_blank_in_its_name_and_options_reach_the_client(self):
        called = self.run_dev("my room.glb", "--error", "0.01", "--no-serve").stdout.split("client|")
        self.assertEqual(called[2:5], ["my room.glb", "-o", "out/my room-lit.glb"])
        self.assertEqual(called[-2:], ["--error", "0.01"])

    def test_serves_the_scene_after_it_is_solved_or_timed_out_but_not_when_asked_not_to(self):
        for status in (0, 3):
            self.assertIn("server|my room.glb", self.run_dev("my room.glb", solve_status=status).stdout)
            self.assertNotIn("server|", self.run_dev("my room.glb", "--no-serve", solve_status=status).stdout)

    def test_serves_where_asked(self):
        self.assertTrue(self.run_dev("my room.glb").stdout.endswith("server|my room.glb"))
        self.assertTrue(self.run_dev("my room.glb", listen="127.0.0.1:9").stdout.endswith("server|--listenserver|127.0.0.1:9"))

    def test_the_exit_code_of_solve_is_passed_on(self):
        for status in (1, 2, 75):
            done = self.run_dev("my room.glb", solve_status=status)
            self.assertEqual(done.returncode, status)
            self.assertNotIn("server|", done.stdout)
        self.assertEqual(self.run_dev("my room.glb", "--no-serve", solve_status=3).returncode, 3)

    def test_paths_are_the_callers_and_outputs_lie_in_the_checkout(self):
        (self.root / "elsewhere").mkdir()
        called = self.run_dev("../my room.glb", "--no-serve", cwd=self.root / "elsewhere").stdout.split("client|")
        self.assertEqual(called[2:5], ["../my room.glb", "-o", f"{self.root}/out/my room-lit.glb"])


class DevTest(Checkout):
    """`./dev test` in a checkout that is built already; ctest prints what it is given and fails."""

    OUTPUT = "\n".join((
        "        Start   1: Room.Works", "  1/3 Test   #1: Room.Works " + "." * 300 + "   Passed    0.01 sec",
        "        Start   2: Room.Leaks", "        Start   3: Room.Waits", "  2/3 Test   #2: Room.Leaks " + "." * 300 +
        "***Failed    0.01 sec", "first line", *(f"line {n}" for n in range(100)), "the reason",
        "  3/3 Test   #3: Room.Waits " + "." * 300 + "***Skipped   0.01 sec", "no Slurm here",
        "", "67% tests passed, 1 tests failed out of 3", "The following tests FAILED:"))

    def setUp(self):
        super().setUp()
        self.stand_in("bin/ninja", 'echo "ninja: no work to do."')
        self.stand_in("bin/npm", "")
        (self.root / "build").mkdir()
        (self.root / "build/build.ninja").touch()
        (self.root / "printed").write_text(self.OUTPUT)
        self.stand_in("bin/ctest", f'cat {self.root}/printed; exit "$STATUS"')

    def run_tests(self, status, *options):
        environment = dict(os.environ, PATH=f"{self.root}/bin:{os.environ['PATH']}", STATUS=str(status))
        return subprocess.run([self.root / "dev", "test", *options], capture_output=True, text=True, timeout=60, cwd=self.root,
                              stdin=subprocess.DEVNULL, env=environment)

    def test_what_failed_is_shown_last_and_no_line_is_wide(self):
        done = self.run_tests(8)
        self.assertEqual(done.returncode, 8)
        again = done.stdout.split("The following tests FAILED:")[1].splitlines()
        self.assertEqual(again[1], "  2/3 Test   #2: Room.Leaks ...***Failed    0.01 sec")
        self.assertEqual((again[-2], again[-1]), ("the reason", "67% tests passed, 1 tests failed out of 3"))
        self.assertNotIn("first line", again)
        self.assertNotIn("no Slurm here", again)
        self.assertLess(max(map(len, done.stdout.splitlines())), 100)

    def again(self, names, again=0, options=("--again",), preset="default"):
        """A run in which these failed at first; its end, and how often ctest was called."""
        log = self.root / ("build" if preset == "default" else f"build-{preset}") / "Testing/Temporary/LastTestsFailed.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        lines = "".join(f"{number}:{name}\\n" for number, name in enumerate(names))
        self.stand_in("bin/ctest", f'echo "$*" >>{self.root}/calls\n[[ "$*" != *--rerun-failed* ]] || '
                      f'{{ echo "100% tests passed, again"; exit {again}; }}\ncat {self.root}/printed\n'
                      f'printf "{lines}" >{log}; exit "$STATUS"')
        (self.root / "calls").write_text("")
        os.environ["RADIOSITY_PRESET"] = preset
        self.addCleanup(os.environ.pop, "RADIOSITY_PRESET", None)
        done = self.run_tests(8, *options)
        calls = (self.root / "calls").read_text().splitlines()
        self.assertFalse(any("--again" in call for call in calls))
        return done, len(calls)

    def test_what_waits_for_programs_is_run_again_if_asked_and_named_if_it_passes(self):
        for names, again, options, status, calls in (
                (["service_state"], 0, (), 8, 1), (["service_state", "web_browser"], 0, ("--again",), 0, 2),
                (["wire_tls"], 8, ("--again",), 8, 2), (["wire_tls", "Room.Leaks"], 0, ("--again",), 8, 1),
                ([f"service_{n}" for n in range(6)], 0, ("--again",), 8, 1)):
            with self.subTest(names=names, again=again, options=options):
                done, called = self.again(names, again, options)
                self.assertEqual((done.returncode, called), (status, calls), done.stderr)
                self.assertEqual("passed only when run again, alone: " + " ".join(names) in done.stderr, status == 0)

    def test_what_a_sanitizer_finds_gets_no_second_try(self):
        (self.root / "build-tsan").mkdir()
        (self.root / "build-tsan/build.ninja").touch()
        done, called = self.again(["service_state"], preset="tsan")
        self.assertEqual((done.returncode, called), (8, 1), done.stderr)

    def test_again_comes_first(self):
        self.assertEqual(self.run_tests(0, "Room", "--again").returncode, 2)

    def test_what_passes_is_shown_once(self):
        done = self.run_tests(0)
        self.assertEqual((done.returncode, done.stdout.count("Room.Leaks")), (0, 1))


class DevLint(Checkout):
    """`./dev lint` where ninja and clang-tidy tell how they were called and have nothing to do, or find something."""

    def setUp(self):
        super().setUp()
        (self.root / "tests").mkdir()
        (self.root / "build-lint").mkdir()
        (self.root / "build-lint/build.ninja").touch()
        for rules in (".clang-tidy", "tests/.clang-tidy"):
            (self.root / rules).write_text("Checks: a")
        self.stand_in("bin/ninja", f'echo "$*" >>{self.root}/calls; echo "$FINDING"; [ -z "$FINDING" ]')

    def lint(self, finding="", options=("--all",)):
        """How it ended, and the calls of ninja or clang-tidy."""
        (self.root / "calls").write_text("")
        environment = dict(os.environ, PATH=f"{self.root}/bin:{os.environ['PATH']}", FINDING=finding)
        done = subprocess.run([self.root / "dev", "lint", *options], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL, env=environment)
        return done, (self.root / "calls").read_text().splitlines()

    def test_builds_with_the_lint_preset_and_goes_on_after_a_finding(self):
        done, calls = self.lint()
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertRegex(calls[-1], rf"^-C {self.root}/build-lint -j \d+ -k 0$")

    def test_sources_are_read_again_only_when_the_rules_changed(self):
        self.lint()
        for rules in (".clang-tidy", "tests/.clang-tidy"):
            self.assertEqual(len(self.lint()[1]), 1)
            (self.root / rules).write_text("Checks: b")
            self.assertEqual(self.lint()[1][0], f"-C {self.root}/build-lint -t clean")

    def test_a_finding_is_shown_and_fails(self):
        self.lint()
        done, _ = self.lint(finding="room.cpp:3:1: error: unused [check]")
        self.assertEqual(done.returncode, 1)
        self.assertIn("room.cpp:3:1: error: unused [check]", done.stderr)

    def git(self, *arguments):
        subprocess.run(["git", "-c", "user.name=t", "-c", "user.email=t@t", *arguments], cwd=self.root, check=True,
                       capture_output=True)

    def test_without_all_only_what_differs_from_main_is_read(self):
        sources = {"common/a.h": "", "common/a.cpp": '#include "common/a.h"\n', "common/b.cpp": "", "common/c.cpp": ""}
        (self.root / "common").mkdir()
        for name, text in sources.items():
            (self.root / name).write_text(text)
        commands = [{"file": f"{self.root}/{name}"} for name in sources if name.endswith(".cpp")]
        (self.root / "build-lint/compile_commands.json").write_text(json.dumps(commands))
        self.git("init", "-q", "-b", "main")
        self.git("add", ".")
        self.git("commit", "-qm", "first")
        self.stand_in("bin/clang-tidy-14", f'echo "${{@: -1}}" >>{self.root}/calls; echo "$FINDING"; [ -z "$FINDING" ]')
        done, calls = self.lint(options=())
        self.assertEqual((done.returncode, calls), (0, []))
        (self.root / "common/a.h").write_text("// changed")
        (self.root / "common/b.cpp").write_text("// changed")
        (self.root / "common/no_target.cpp").write_text("")
        done, calls = self.lint(options=())
        self.assertEqual((done.returncode, sorted(calls)), (0, [f"{self.root}/common/a.cpp", f"{self.root}/common/b.cpp"]))
        done, _ = self.lint(finding="b.cpp:1:1: error: wrong [check]", options=())
        self.assertEqual(done.returncode, 1)
        self.assertIn("b.cpp:1:1: error: wrong [check]", done.stdout)

    def test_other_options_are_refused(self):
        self.assertEqual(self.lint(options=("--al",))[0].returncode, 2)


class DevFuzz(Checkout):
    """`./dev fuzz` where ninja has nothing to do and two targets tell how they were called."""

    def setUp(self):
        super().setUp()
        self.stand_in("bin/ninja", 'echo "ninja: no work to do."')
        (self.root / "build-fuzz").mkdir()
        (self.root / "build-fuzz/build.ninja").touch()
        for name in ("apple", "pear"):
            self.stand_in(f"build-fuzz/tests/fuzz/{name}_replay", 'echo seed >"$2/seed-0"')
            self.stand_in(f"build-fuzz/tests/fuzz/{name}_fuzz",
                          f'echo "{name} $*" >>{self.root}/calls; echo "stat::number_of_executed_units: 7"; '
                          f'echo "wrong in {name}"; [ "$FINDS" != {name} ]')

    def fuzz(self, *options, finds=""):
        """How it ended, and how the targets were called."""
        (self.root / "calls").write_text("")
        environment = dict(os.environ, PATH=f"{self.root}/bin:{os.environ['PATH']}", FINDS=finds)
        done = subprocess.run([self.root / "dev", "fuzz", *options], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL, env=environment)
        return done, sorted((self.root / "calls").read_text().splitlines())

    def test_every_target_searches_from_its_own_seeds_for_so_long(self):
        done, calls = self.fuzz("5")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([call.split()[0] for call in calls], ["apple", "pear"])
        for name, call in zip(("apple", "pear"), calls):
            self.assertIn("-max_total_time=5 ", call)
            self.assertTrue(call.endswith(f"{self.root}/out/fuzz/{name}"), call)
            self.assertTrue((self.root / f"out/fuzz/{name}/seed-0").exists())
            self.assertIn(f"{name}: 7 inputs, nothing found", done.stderr)

    def test_what_one_finds_is_shown_and_fails_and_the_others_go_on(self):
        for finds, other in (("apple", "pear"), ("pear", "apple")):
            done, calls = self.fuzz(finds=finds)
            self.assertEqual((done.returncode, len(calls)), (1, 2))
            self.assertIn(f"wrong in {finds}", done.stderr)
            self.assertIn(f"{finds}: found something", done.stderr)
            self.assertIn(f"{other}: 7 inputs, nothing found", done.stderr)

    def test_a_name_chooses_and_one_that_fits_none_is_refused(self):
        self.assertEqual([call.split()[0] for call in self.fuzz("1", "pea")[1]], ["pear"])
        self.assertEqual(self.fuzz("1", "plum")[0].returncode, 2)

    def test_the_viewers_packages_are_not_fetched(self):
        (self.root / "client/web").mkdir(parents=True)
        (self.root / "client/web/package-lock.json").touch()
        for name in ("npm", "node"):
            self.stand_in(f"bin/{name}", f"touch {self.root}/fetched")
        self.assertEqual(self.fuzz()[0].returncode, 0)
        self.assertFalse((self.root / "fetched").exists())


if __name__ == "__main__":
    unittest.main()
