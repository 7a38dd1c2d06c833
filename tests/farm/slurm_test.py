"""docker/farm/slurm_array.sh, run by Slurm."""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import plates
import slurm_cluster
from client_options import keeps_state

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "docker/farm/slurm_array.sh"
#: Stands for the client where only the script is tested: waits for SIGTERM and saves, then, tried again, comes to its end.
INTERRUPTED_ONCE = """#!/bin/bash
echo "$@" >> "$TEST_FOLDER/calls"
if [ -e "$TEST_FOLDER/saved" ]; then exit 0; fi
trap 'touch "$TEST_FOLDER/saved"; exit 75' TERM
touch "$TEST_FOLDER/started"
while true; do sleep 0.1; done
"""


@unittest.skipIf(slurm_cluster.missing(), slurm_cluster.missing())
class SlurmArray(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-slurm-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        (self.folder / "cluster").mkdir()
        self.cluster = slurm_cluster.Cluster(self.folder / "cluster")
        self.addCleanup(self.cluster.stop)
        self.cluster.environment.update(TEST_FOLDER=str(self.folder), RADIOSITY=os.environ["RADIOSITY"])
        self.out = self.folder / "out"

    def submit(self, scenes, *options):
        listing = self.folder / "scenes.txt"
        listing.write_text("".join(f"{scene}\n" for scene in scenes))
        return self.cluster.submit(f"--array=1-{len(scenes)}", "--cpus-per-task=1", f"--output={self.folder}/log-%a.txt",
                                   SCRIPT, listing, self.out, *options)

    def log(self, task):
        return (self.folder / f"log-{task}.txt").read_text()

    def scene(self, name):
        path = self.folder / f"{name}.glb"
        plates.write_glb(path, plates.document())
        return path

    @keeps_state
    def test_each_task_lights_its_scene(self):
        job = self.submit([self.scene("first"), self.scene("second")], "--error", "0.1", "--texels", "500")
        for task, name in ((1, "first"), (2, "second")):
            state = self.cluster.wait(f"{job}_{task}", ("COMPLETED", "FAILED"))
            self.assertEqual(state, "COMPLETED", self.log(task))
            self.assertTrue((self.out / f"{name}-lit.glb").exists(), self.log(task))
            report = json.loads((self.out / f"{name}.json").read_text())
            self.assertLessEqual(report["error"]["total"], 0.1)

    @keeps_state
    def test_a_scene_that_is_none_fails_its_task_alone(self):
        bad = self.folder / "bad.glb"
        bad.write_text("no scene")
        job = self.submit([bad, self.scene("good")], "--error", "0.1", "--texels", "500")
        self.assertEqual(self.cluster.wait(f"{job}_1", ("COMPLETED", "FAILED")), "FAILED")
        self.assertEqual(self.cluster.field(f"{job}_1", "ExitCode"), "2:0")
        self.assertEqual(self.cluster.field(f"{job}_1", "Restarts"), "0")
        self.assertEqual(self.cluster.wait(f"{job}_2", ("COMPLETED", "FAILED")), "COMPLETED", self.log(2))

    def test_a_task_that_is_interrupted_goes_back_into_the_queue(self):
        fake = self.folder / "radiosity"
        fake.write_text(INTERRUPTED_ONCE)
        fake.chmod(0o755)
        self.cluster.environment["RADIOSITY"] = str(fake)
        task = f"{self.submit(['a.glb'], '--error', '0.05')}_1"
        self.cluster.until((self.folder / "started").exists, "the task runs")
        self.cluster.call("scancel", "--signal=TERM", "--batch", task)
        self.cluster.wait(task, ("PENDING",))
        self.cluster.hurry(task)
        self.assertEqual(self.cluster.wait(task, ("COMPLETED", "FAILED")), "COMPLETED", self.log(1))
        self.assertEqual(self.cluster.field(task, "Restarts"), "1")
        first, second = (self.folder / "calls").read_text().splitlines()
        self.assertEqual(first, second)  # the same state folder, so that it goes on
        self.assertIn(f"--state {self.out}/state/a", first)
        self.assertIn("--error 0.05", first)

    @keeps_state
    def test_a_real_solve_that_is_interrupted_goes_on(self):
        room = os.environ.get("RADIOSITY_ROOM", "")
        if not pathlib.Path(room).exists():
            self.skipTest("the room was not built")
        # An error that is never reached: the solve lasts until it is interrupted, and then until its time is up.
        task = f"{self.submit([room], '--error', '1e-6', '--time-limit', '20')}_1"
        state = self.out / "state" / pathlib.Path(room).stem
        self.cluster.until(lambda: state.exists() and any(state.iterdir()), "the solve keeps a state")
        self.cluster.call("scancel", "--signal=TERM", "--batch", task)
        self.cluster.wait(task, ("PENDING",))
        self.assertIn("state saved", self.log(1))
        self.cluster.hurry(task)
        self.cluster.wait(task, ("COMPLETED", "FAILED"))
        self.assertEqual(self.cluster.field(task, "ExitCode"), "3:0", self.log(1))
        self.assertTrue(list(self.out.glob("*-lit.glb")), self.log(1))


class Script(unittest.TestCase):
    """What needs no Slurm."""

    def run_task(self, *arguments, **environment):
        clean = {name: value for name, value in os.environ.items() if not name.startswith("SLURM_")}
        return subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, check=False,
                              env={**clean, **environment}, timeout=60)

    def test_usage_is_said(self):
        done = self.run_task()
        self.assertEqual(done.returncode, 2)
        self.assertIn("usage: sbatch", done.stderr)

    def test_the_number_of_workers_is_named_only_where_slurm_names_one(self):
        with tempfile.TemporaryDirectory(prefix="radiosity-slurm-") as folder:
            scenes = pathlib.Path(folder) / "scenes.txt"
            scenes.write_text("a.glb\n")
            for cpus, workers in (({"SLURM_CPUS_PER_TASK": "3"}, "--workers 3"), ({}, None)):
                done = self.run_task(str(scenes), folder, "--error", "0.05", RADIOSITY="echo", SLURM_ARRAY_TASK_ID="1", **cpus)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn(f"--state {folder}/state/a --error 0.05", done.stdout)
                self.assertEqual(workers in done.stdout if workers else "--workers" not in done.stdout, True, done.stdout)

    def test_stopped_before_the_solve_listens_it_goes_back_into_the_queue(self):
        listens = "#!/bin/sh\ntrap 'exit 75' TERM\n"
        stops, waits = "kill -TERM $PPID\n", "while [ -e \"$0\" ]; do sleep 0.05; done\n"
        # Before there is a solve; when it is there and takes no notice yet; and when it listens.
        for mkdir, solve in ((stops, listens + waits), ("", "#!/bin/sh\n" + stops + waits), ("", listens + stops + waits)):
            with tempfile.TemporaryDirectory(prefix="radiosity-slurm-") as folder:
                for name, text in (("mkdir", f"#!/bin/sh\n{mkdir}exec /bin/mkdir \"$@\"\n"), ("radiosity", solve),
                                   ("scontrol", "#!/bin/sh\necho \"$@\" >> \"$CALLS\"\nexit 1\n")):
                    program = pathlib.Path(folder) / name
                    program.write_text(text)
                    program.chmod(0o755)
                (pathlib.Path(folder) / "scenes.txt").write_text("a.glb\n")
                done = self.run_task(f"{folder}/scenes.txt", folder, RADIOSITY=f"{folder}/radiosity", SLURM_ARRAY_TASK_ID="1",
                                     SLURM_ARRAY_JOB_ID="7", CALLS=f"{folder}/calls", PATH=f"{folder}:{os.environ['PATH']}")
                self.assertEqual(done.returncode, 75, done)
                self.assertEqual((pathlib.Path(folder) / "calls").read_text(), "requeue 7_1\n")


if __name__ == "__main__":
    unittest.main()
