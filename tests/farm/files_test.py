"""What lies in docker/: each file is what its reader takes it for, and says what is true of our programs."""
import copy
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import openjd_schema
import yaml
from client_options import keeps_state, options_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCKER = ROOT / "docker"
UID = "10001"


def load(path):
    specification = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


class Dockerfile(unittest.TestCase):
    def setUp(self):
        self.text = (DOCKER / "Dockerfile").read_text(encoding="utf-8")
        self.steps = load(DOCKER / "without_docker.py").parse(self.text)
        last = max(i for i, s in enumerate(self.steps) if s.name == "FROM")
        self.build, self.image = self.steps[:last], self.steps[last:]

    def of(self, name, steps):
        return [step for step in steps if step.name == name]

    def test_stages_are_bookworm_and_the_image_has_no_compiler(self):
        froms = self.of("FROM", self.steps)
        self.assertEqual([step.text for step in froms], ["debian:bookworm-slim AS build", "debian:bookworm-slim"])
        installed = " ".join(step.text for step in self.of("RUN", self.image))
        self.assertNotRegex(installed, r"-dev\b|g\+\+|cmake|npm")

    def test_it_runs_as_nobody_special_and_has_a_health_check(self):
        self.assertEqual(self.of("USER", self.image)[-1].text, f"{UID}:{UID}")
        self.assertIn("/healthz", self.of("HEALTHCHECK", self.image)[0].text)
        command = self.of("CMD", self.image)[0].words()
        self.assertNotIn("--insecure", command)
        self.assertIn("--token-file", command)
        self.assertLessEqual({word for word in command if word.startswith("--")}, options_of("RADIOSITYD"))

    def test_it_installs_what_dev_installs_to_build(self):
        """A package that `dev` learns of must not be forgotten here."""
        dev = (ROOT / "dev").read_text(encoding="utf-8")
        wanted = set(re.search(r"^packages=\((.*?)^\)", dev, re.MULTILINE | re.DOTALL).group(1).split())
        tests_only = {"ccache", "python3", "python3-websockets", "python3-yaml", "openssl", "nodejs", "node-ws", "libgtest-dev",
                      "libgmock-dev", "libbenchmark-dev", "libembree-dev", "libegl1", "libegl-mesa0", "libgl1-mesa-dri"}
        installed = set(re.findall(r"[a-z0-9][a-z0-9+.-]+", self.of("RUN", self.build)[0].text))
        self.assertEqual(wanted - tests_only - installed, set())
        running = set(re.findall(r"[a-z0-9][a-z0-9+.-]+", self.of("RUN", self.image)[0].text))
        # Loaded by name as the programs run, so that no linker tells of them.
        self.assertLessEqual({"libegl1", "libegl-mesa0", "libgl1", "libgl1-mesa-dri"}, running)

    def test_the_image_holds_every_library_that_the_programs_need(self):
        if shutil.which("dpkg-query") is None:
            self.skipTest("not Debian")
        running = set(re.findall(r"[a-z0-9][a-z0-9+.-]+", self.of("RUN", self.image)[0].text))
        # What the image of Debian itself holds, and what a package named there depends on.
        needed = set()
        for variable in ("RADIOSITYD", "RADIOSITY"):
            libraries = subprocess.run(["readelf", "-d", os.environ[variable]], capture_output=True, text=True, check=True)
            needed |= set(re.findall(r"NEEDED.*\[(.*)\]", libraries.stdout))
        for library in sorted(needed):
            found = subprocess.run(["dpkg-query", "-S", f"*/{library}"], capture_output=True, text=True, check=False).stdout
            packages = {line.split(":")[0] for line in found.splitlines()}
            base = {"libc6", "libgcc-s1", "libstdc++6", "zlib1g"}
            if "asan" in library or "tsan" in library or "ubsan" in library:
                continue  # of a build for tests
            self.assertTrue(packages & (running | base), f"{library} is in {packages or 'no package'}")

    def test_what_it_copies_is_there_and_not_ignored(self):
        let_in = {line[1:] for line in (DOCKER / "Dockerfile.dockerignore").read_text().splitlines() if line.startswith("!")}
        for step in self.of("COPY", self.build):
            for source in step.words()[:-1]:
                self.assertTrue((ROOT / source).exists(), source)
                self.assertIn(source.split("/")[0], let_in)

    def test_a_dockerfile_that_is_cut_short_is_refused(self):
        with self.assertRaises(ValueError):
            load(DOCKER / "without_docker.py").parse("FROM a\nRUN x \\\n")


    def test_what_it_takes_to_do_without_docker_is_asked_for_first(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder) / "stages"
            done = subprocess.run([sys.executable, DOCKER / "without_docker.py", "--root", root], env={"PATH": folder},
                                  capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 2)
            self.assertIn("apt-get install debootstrap", done.stderr)
            self.assertNotIn("Traceback", done.stderr)
            self.assertFalse(root.exists())


class OpenJobDescription(unittest.TestCase):
    def setUp(self):
        self.template = yaml.safe_load((DOCKER / "farm/openjd_template.yaml").read_text(encoding="utf-8"))

    def test_it_is_a_valid_template(self):
        openjd_schema.check(self.template)

    def test_the_check_refuses_what_is_wrong(self):
        def spoil(change):
            template = copy.deepcopy(self.template)
            change(template)
            return template

        def on_run(template):
            return template["steps"][0]["script"]["actions"]["onRun"]

        for change in (
                lambda t: t.update(specificationVersion="jobtemplate-2024-01"),
                lambda t: t.update(surprise=1),
                lambda t: t.pop("steps"),
                lambda t: t.update(name="{{Param.Output}}"),
                lambda t: t["parameterDefinitions"].append(t["parameterDefinitions"][0]),
                lambda t: t["parameterDefinitions"][3].update(default=2),
                lambda t: on_run(t)["args"].append("{{Param.Missing}}"),
                lambda t: on_run(t)["args"].append("{{Task.Param.Scene"),
                lambda t: on_run(t)["cancelation"].update(notifyPeriodInSeconds=601),
                lambda t: t["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0].update(range="1-x")):
            with self.assertRaises(openjd_schema.Invalid):
                openjd_schema.check(spoil(change))

    @keeps_state
    def test_its_options_are_those_of_the_client(self):
        arguments = self.template["steps"][0]["script"]["actions"]["onRun"]["args"]
        self.assertEqual(arguments[0], "solve")
        self.assertLessEqual({a for a in arguments if a.startswith("-")}, options_of("RADIOSITY", "solve"))


#: What a `radiosity` of the tests does: waits for SIGTERM, and ends with the number that is put in; or waits and dies of it.
LISTEN = "trap 'exit %d' TERM; touch started; while [ -e \"$0\" ]; do sleep 0.05; done"
UNAWARE = "touch started; while [ -e \"$0\" ]; do sleep 0.05; done"


class KubernetesJob(unittest.TestCase):
    def setUp(self):
        self.job = yaml.safe_load((DOCKER / "farm/kubernetes_job.yaml").read_text(encoding="utf-8"))
        self.pod = self.job["spec"]["template"]["spec"]
        self.container = self.pod["containers"][0]

    def test_it_is_an_indexed_job_whose_interrupted_pods_are_tried_again(self):
        self.assertEqual((self.job["apiVersion"], self.job["kind"]), ("batch/v1", "Job"))
        spec = self.job["spec"]
        self.assertEqual(spec["completionMode"], "Indexed")
        # podFailurePolicy is allowed with this alone.
        self.assertEqual(self.pod["restartPolicy"], "Never")
        self.assertGreaterEqual(self.pod["terminationGracePeriodSeconds"], 30)
        actions = {}
        for rule in spec["podFailurePolicy"]["rules"]:
            self.assertEqual(len({"onExitCodes", "onPodConditions"} & set(rule)), 1)
            for code in rule.get("onExitCodes", {}).get("values", []):
                self.assertEqual(rule["onExitCodes"]["containerName"], self.container["name"])
                self.assertNotEqual(code, 0)
                actions[code] = rule["action"]
        self.assertEqual(actions, {75: "Ignore", 1: "FailJob", 2: "FailJob"})

    def test_it_runs_as_the_image_does_and_may_do_nothing_more(self):
        self.assertEqual(str(self.pod["securityContext"]["runAsUser"]), UID)
        self.assertTrue(self.pod["securityContext"]["runAsNonRoot"])
        self.assertFalse(self.container["securityContext"]["allowPrivilegeEscalation"])
        self.assertEqual(self.container["securityContext"]["capabilities"], {"drop": ["ALL"]})
        volumes = {volume["name"] for volume in self.pod["volumes"]}
        self.assertEqual({mount["name"] for mount in self.container["volumeMounts"]}, volumes)

    def run_script(self, exit_code, wait="", terminate=False, before=""):
        """The container's command with a `radiosity` that does `wait` and ends so, SIGTERM being sent to the command once there
        is a file `started`; `before`: what the command's shell does just before it. Status, and arguments of `radiosity`."""
        with tempfile.TemporaryDirectory() as folder:
            fake = pathlib.Path(folder) / "radiosity"
            fake.write_text(f"#!/bin/sh\necho \"$@\" > arguments\n{wait}\nexit {exit_code}\n")
            fake.chmod(0o755)
            script = [arg.replace("radiosity solve", f"{before}\nradiosity solve", 1) for arg in self.container["args"]]
            process = subprocess.Popen([*self.container["command"], *script], cwd=folder, stderr=subprocess.DEVNULL,
                                       env={"PATH": f"{folder}:{os.environ['PATH']}", "JOB_COMPLETION_INDEX": "4"})
            try:
                if terminate:
                    while not (pathlib.Path(folder) / "started").exists():
                        self.assertIsNone(process.poll())
                    process.terminate()
                code = process.wait(60)
            finally:
                process.kill()
                process.wait()
            arguments = pathlib.Path(folder) / "arguments"
            return code, arguments.read_text() if arguments.exists() else ""

    def test_its_command_passes_codes_and_signals_on(self):
        for given, wanted in ((0, 0), (1, 1), (2, 2), (3, 0), (75, 75)):
            self.assertEqual(self.run_script(given)[0], wanted)
        code, arguments = self.run_script(75, LISTEN % 75, terminate=True)
        self.assertEqual(code, 75)
        self.assertIn("/data/scene-4.glb", arguments)
        self.assertIn("--state /data/state/scene-4", arguments)

    def test_stopped_before_the_solve_listens_it_is_tried_again(self):
        self.assertEqual(self.run_script(0, UNAWARE, terminate=True)[0], 75)
        # Not even started, it is, or is not, told: more than once, for it is a matter of luck where it could be either.
        for _ in range(10):
            self.assertEqual(self.run_script(0, LISTEN % 75, before="kill -TERM $$")[0], 75)
        # Killed by somebody else it is no other than before: Kubernetes counts it.
        self.assertEqual(self.run_script(0, "kill -TERM $$")[0], 143)

    @keeps_state
    def test_its_options_are_those_of_the_client(self):
        _, arguments = self.run_script(0)
        self.assertLessEqual({a for a in arguments.split() if a.startswith("-")}, options_of("RADIOSITY", "solve"))


class ServiceUnit(unittest.TestCase):
    def test_systemd_takes_it(self):
        analyze = shutil.which("systemd-analyze")
        if analyze is None:
            self.skipTest("systemd-analyze is not here")
        unit = (DOCKER / "systemd/radiosityd.service").read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder) / "radiosityd.service"
            # The program lies elsewhere while it is tested; a unit's program must exist.
            place.write_text(unit.replace("/usr/local/bin/radiosityd", str(pathlib.Path(os.environ["RADIOSITYD"]).resolve())))
            # Whether its manual pages are installed here is not the unit's affair.
            done = subprocess.run([analyze, "--man=no", "verify", place], capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))
            rated = subprocess.run([analyze, "security", "--offline=true", "--threshold=20", place], capture_output=True,
                                   text=True, check=False)
            self.assertEqual(rated.returncode, 0, rated.stdout)

    def test_it_starts_the_server_with_options_that_there_are(self):
        unit = (DOCKER / "systemd/radiosityd.service").read_text(encoding="utf-8")
        start = re.search(r"^ExecStart=(.*)$", unit, re.MULTILINE).group(1)
        self.assertLessEqual(set(re.findall(r"--[a-z-]+", start)), options_of("RADIOSITYD"))
        self.assertIn("Type=notify", unit)
        # Longer than what a healthy event loop may be silent, see server/service_notify.h.
        self.assertGreater(int(re.search(r"^WatchdogSec=(\d+)$", unit, re.MULTILINE).group(1)), 30)


if __name__ == "__main__":
    unittest.main()
