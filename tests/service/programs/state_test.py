"""`--state`: what was acknowledged outlives kill -9, a solve outlives SIGTERM, and a bad disk loses nothing in silence."""
import asyncio
import hashlib
import json
import os
import random
import signal
import subprocess
import time
import unittest
import urllib.error
import urllib.request

import plates
from edit_load import Ledger, load_for, scene_with_counters
from harness import CHOSEN, MARK, ServiceCase, marked_processes, program
from patience import PATIENCE
from wire import RpcError, Session

KILLS = 20
UNAVAILABLE = -32050
STRENGTH = "/materials/@lamp/extensions/KHR_materials_emissive_strength/emissiveStrength"
SLOW = ("--error", 0.012, "--texels", 8000, "--workers", 1)


def brighter(nits):
    return [{"op": "replace", "path": STRENGTH, "value": nits}]


class StateCase(ServiceCase):
    def setUp(self):
        super().setUp()
        self.state = self.folder / "state"
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, scene_with_counters())

    def run_async(self, coroutine, seconds=300 * PATIENCE):
        return asyncio.run(asyncio.wait_for(coroutine, seconds))

    def keeper(self, *arguments, **options):
        return self.server(self.scene, "--state", self.state, "--texels", 500, "--error", 0.05, *arguments, **options)

    def refused(self, *arguments, expect):
        """A server that must not start; returns its one line."""
        done = subprocess.run([program("RADIOSITYD"), "--listen", "127.0.0.1:0", *map(str, arguments)],
                              capture_output=True, text=True, timeout=60 * PATIENCE, check=False,
                              env={**os.environ, MARK: self.mark})
        self.assertEqual(done.returncode, expect, done.stderr)
        return done.stderr.strip().splitlines()[-1]

    def put(self, url, path, body):
        request = urllib.request.Request(url + path, data=body, method="PUT",
                                         headers={"Content-Type": "application/octet-stream"})
        with urllib.request.urlopen(request, timeout=60 * PATIENCE) as answer:
            return json.load(answer)


class KilledTest(StateCase):
    def test_noAcknowledgedEditIsLostAndNoneIsMadeTwice(self):
        ledger, dice = Ledger(), random.Random(1)
        for _ in range(KILLS):
            server = self.keeper()
            lost = self.run_async(ledger.check(server.url))
            self.assertEqual(lost, 0, server.log())
            self.run_async(load_for(ledger, server.url, dice.uniform(0.02, 0.5), server.process.kill))
            server.kill()
        server = self.keeper()
        self.assertEqual(self.run_async(ledger.check(server.url)), 0)
        self.assertGreater(ledger.total, KILLS)
        self.assertEqual(server.terminate(), 0, server.log())

    def test_aServerChoosesTexelsFromTheStartAndAfterItWasKilled(self):
        for _ in range(2):
            server = self.keeper(CHOSEN)

            async def settings():
                session = await Session.open(server.url)
                return await session.call("solve.configure")

            found = self.run_async(settings())
            self.assertEqual((found["adaptive"], found["texels"]), (True, 500))
            server.kill()

    def test_aSkyOutlivesAKillAndCanBeTakenBack(self):
        def sky(server):
            try:
                with urllib.request.urlopen(server.url + "/sky.hdr", timeout=60 * PATIENCE) as answer:
                    return answer.read()
            except urllib.error.HTTPError as error:
                return error.code  # 404: the sky is no picture

        async def call(server, method, **arguments):
            session = await Session.open(server.url)
            return await session.call(method, **arguments)

        server = self.keeper()
        before = sky(server)
        daylight = {"daylight": {"sky": "overcast", "altitude": 30}}
        self.run_async(call(server, "scene.patch", patch=[{"op": "add", "path": "/extras",
                                                           "value": {"radiositySky": daylight}}]))
        overcast = sky(server)
        self.assertEqual(before, 404)
        self.assertIsInstance(overcast, bytes)
        server.kill()
        server = self.keeper()
        self.assertEqual(sky(server), overcast)
        self.run_async(call(server, "scene.undo", requestId="back"))
        self.assertEqual(sky(server), before)
        self.assertEqual(server.terminate(), 0, server.log())

    def test_undoAndHistoryGoOn(self):
        server = self.keeper()

        async def first():
            session = await Session.open(server.url)
            for nits in (20, 30):
                await session.call("scene.patch", patch=brighter(nits))
            undone = await session.call("scene.undo", requestId="back")
            return (await session.call("scene.history"))["revisions"], undone

        before, undone = self.run_async(first())
        server.kill()
        server = self.keeper()

        async def second():
            session = await Session.open(server.url)
            self.assertEqual((await session.call("scene.history"))["revisions"], before)
            self.assertEqual(await session.call("scene.undo", requestId="back"), undone)
            with self.assertRaises(RpcError) as other:
                await session.call("scene.redo", requestId="back")
            self.assertEqual(other.exception.code, -32602)
            self.assertEqual((await session.call("scene.redo"))["edit"], 3)
            scene = (await session.call("scene.get"))["gltf"]
            lamp = scene["materials"][plates.LAMP_MATERIAL]["extensions"]["KHR_materials_emissive_strength"]
            self.assertEqual(lamp["emissiveStrength"], 30)

        self.run_async(second())

    def test_whoHasLoadedTheSceneIsKnownAfterwards(self):
        async def loads(url):
            session = await Session.open(url)
            return [(r["kind"], r.get("by")) for r in (await session.call("scene.history"))["revisions"]]

        async def load(url, upload):
            await (await Session.open(url)).call("scene.load", url=upload)

        server = self.keeper()
        deadline = time.monotonic() + 60 * PATIENCE
        while not (known := self.run_async(loads(server.url))):  # the command line's is read while clients come
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        self.assertEqual(known, [("load", None)])
        body = self.scene.read_bytes()
        self.put(server.url, "/scene?client=Ann", body)
        self.assertEqual(self.run_async(loads(server.url)), [("load", "Ann")])
        self.put(server.url, "/scene", body)
        self.assertRegex(self.run_async(loads(server.url))[0][1], "^Python-urllib/[0-9.]+$")
        self.run_async(load(server.url, self.put(server.url, "/uploads", body)["url"]))
        server.kill()
        self.assertEqual(self.run_async(loads(self.keeper().url)), [("load", "service test")])

    def test_whoComesBackGetsWhatWasMissed(self):
        server = self.keeper()

        async def first():
            session = await Session.open(server.url)
            await session.call("solve.wait", timeoutMs=60000)
            await session.call("subscribe")
            bookmark = (await session.note("bookmark"))["params"]
            held = {"epoch": session.info["epoch"], "revision": bookmark["revision"],
                    "tileVersion": bookmark["tileVersion"]}
            other = await Session.open(server.url)
            await other.call("scene.patch", patch=brighter(20))
            await other.call("scene.patch", patch=brighter(40))
            return held

        held = self.run_async(first())
        server.kill()
        server = self.keeper()

        async def second():
            session = await Session.open(server.url, resume=held)
            self.assertEqual(session.info["epoch"], held["epoch"])
            self.assertTrue(session.hello["resumed"])
            missed = [(await session.note("scene.patched"))["params"] for _ in range(2)]
            self.assertEqual([m["revision"] for m in missed], [2, 3])
            self.assertEqual(missed[1]["by"], "service test")
            await session.call("solve.wait", timeoutMs=60000)
            await session.call("subscribe")
            await session.note("lightmaps")
            bookmark = (await session.note("bookmark"))["params"]
            self.assertGreater(bookmark["tileVersion"], held["tileVersion"])
            self.assertTrue(session.tiles, "the tiles of the last process are nobody's any more")
            stranger = await Session.open(server.url, resume={**held, "epoch": "another"})
            self.assertFalse(stranger.hello["resumed"])

        self.run_async(second())

    def test_uploadsAndSettingsAreStillThere(self):
        server = self.keeper()
        plates.write_glb(self.folder / "other.glb", plates.document())
        body = (self.folder / "other.glb").read_bytes()
        url = self.put(server.url, "/uploads?name=again.glb", body)["url"]
        self.assertEqual(url, "/uploads/" + hashlib.sha256(body).hexdigest())

        async def configure():
            session = await Session.open(server.url)
            return await session.call("solve.configure", seed=5, sky={"upper": [1, 2, 3]}, texels=400,
                                          doubleSided=True)

        settings = self.run_async(configure())
        server.kill()
        server = self.server("--state", self.state)

        async def second():
            session = await Session.open(server.url)
            kept = (await session.call("status"))["settings"]
            self.assertEqual({**kept, "targetError": 0}, {**settings, "targetError": 0})
            self.assertEqual((await session.call("scene.load", url=url))["revision"], 2)

        self.run_async(second())

    def test_theSceneOnTheCommandLineIsLoadedOnceAndAnewWhereThatIsAskedFor(self):
        def revision(server):
            async def ask():
                session = await Session.open(server.url)
                while (await session.call("status"))["state"] in ("empty", "loading"):
                    await asyncio.sleep(0.01)
                await asyncio.sleep(0.2)  # SCENE is looked at after the port is open
                await session.call("scene.get")
                return (await session.call("status"))["revision"]
            return self.run_async(ask())

        server = self.keeper()
        self.assertEqual(revision(server), 1)
        server.kill()
        server = self.keeper()
        self.assertEqual(revision(server), 1)
        server.kill()
        plates.write_glb(self.scene, plates.document())
        server = self.keeper()
        self.assertEqual(revision(server), 1)
        self.assertIn("--reload", server.log())
        server.kill()
        server = self.keeper("--reload")
        self.assertEqual(revision(server), 2)
        server.kill()
        server = self.keeper()
        self.assertEqual(revision(server), 2)
        self.assertNotIn("--reload", server.log())


class SolveTest(StateCase):
    def setUp(self):
        super().setUp()
        self.room = os.environ["RADIOSITY_ROOM"]  # takes long enough to be interrupted

    def output(self, stem):
        return [(self.folder / f"{stem}{ending}").read_bytes() for ending in (".glb", ".lightmap.0.exr")]

    def interrupt(self, number, *arguments):
        """Starts a solve, ends it once it has a checkpoint to improve on."""
        checkpoint = self.state / "checkpoint"
        before = checkpoint.stat().st_mtime_ns if checkpoint.exists() else 0
        process = self.start("solve", self.room, "-o", "kept.glb", "--state", self.state, *arguments)
        deadline = time.monotonic() + 120
        while not checkpoint.exists() or checkpoint.stat().st_mtime_ns == before:
            self.assertIsNone(process.poll(), "the solve ended before it could be interrupted")
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        process.send_signal(number)
        self.assertEqual(process.wait(60), 75)
        self.assertIn("goes on from there", process.stderr.read())
        self.assertNothingLeft()

    def test_aSolveThatIsInterruptedAgainAndAgainEndsWithTheSameOutput(self):
        self.client("solve", self.room, "-o", "whole.glb", *SLOW)
        for number in (signal.SIGTERM, signal.SIGINT):
            self.interrupt(number, *SLOW)
            self.assertFalse((self.folder / "kept.glb").exists())
        self.client("solve", self.room, "-o", "kept.glb", "--state", self.state, "--report", "r.json", *SLOW)
        self.assertEqual(self.output("kept"), self.output("whole"))
        # Once more: it is done already, and the output is the same.
        shots = json.loads((self.folder / "r.json").read_text())["shots"]
        self.client("solve", self.room, "-o", "kept.glb", "--state", self.state, "--report", "r.json", *SLOW)
        self.assertEqual(self.output("kept"), self.output("whole"))
        self.assertEqual(json.loads((self.folder / "r.json").read_text())["shots"], shots)

    def test_aSolveThatChoosesTexelsGoesOnWithThoseThatItHadChosen(self):
        chosen = ("--error", 0.015, "--workers", 1, CHOSEN)
        self.client("solve", self.room, "-o", "whole.glb", "--report", "whole.json", *chosen)
        for _ in range(2):
            self.interrupt(signal.SIGTERM, *chosen)
        self.client("solve", self.room, "-o", "kept.glb", "--state", self.state, "--report", "r.json", *chosen)
        whole, kept = (json.loads((self.folder / name).read_text()) for name in ("whole.json", "r.json"))
        self.assertEqual((kept["state"], kept["patches"]), (whole["state"], whole["patches"]))
        self.assertEqual(self.output("kept"), self.output("whole"))

    def test_aKilledSolveGoesOnFromItsLastCheckpoint(self):
        self.interrupt(signal.SIGTERM, *SLOW)
        process = self.start("solve", self.room, "-o", "kept.glb", "--state", self.state, *SLOW)
        time.sleep(0.5)
        process.kill()
        process.wait()
        self.assertNothingLeft()
        self.client("solve", self.room, "-o", "kept.glb", "--state", self.state, *SLOW)
        self.client("solve", self.room, "-o", "whole.glb", *SLOW)
        self.assertEqual(self.output("kept"), self.output("whole"))

    def test_anotherSceneInTheSameFolderIsSolvedAfresh(self):
        quick = ("--error", 0.05, "--texels", 1000)
        self.client("solve", self.scene, "-o", "kept.glb", "--state", self.state, *quick)
        plates.write_glb(self.scene, plates.document())
        self.client("solve", self.scene, "-o", "kept.glb", "--state", self.state, *quick)
        self.client("solve", self.scene, "-o", "whole.glb", *quick)
        self.assertEqual(self.output("kept"), self.output("whole"))

    def test_stateGoesWithAPrivateServerAlone(self):
        _, errors = self.client("solve", self.scene, "-o", "a.glb", "--state", "s", "--server", "127.0.0.1:1", expect=2)
        self.assertIn("--state", errors)


class BadDiskTest(StateCase):
    def filled(self):
        server = self.keeper()

        async def edit():
            session = await Session.open(server.url)
            for nits in (20, 30, 40):
                await session.call("scene.patch", patch=brighter(nits))

        self.run_async(edit())
        self.assertEqual(server.terminate(), 0, server.log())

    def test_damageIsNamedAndNothingStarts(self):
        self.filled()
        database = self.state / "state.sqlite"
        sound = database.read_bytes()
        damaged = {
            "truncated": sound[:len(sound) // 2], "empty": b"", "no database": b"x" * 8192,
            "flipped": sound.replace(b"replace /materials", b"replace /naterials", 1),
        }
        for what, content in damaged.items():
            with self.subTest(what=what):
                self.assertTrue(content != sound)
                database.write_bytes(content)
                line = self.refused(self.scene, "--state", self.state, expect=2)
                self.assertIn(str(database), line)
                self.assertEqual(database.read_bytes()[:len(content)], content, "it must stay as it was found")
        database.write_bytes(sound)
        blob = next((self.state / "blobs").iterdir())
        blob.write_bytes(b"?" + blob.read_bytes()[1:])
        self.assertIn(str(blob), self.refused("--state", self.state, expect=2))

    def test_aDamagedCheckpointCostsNoMoreThanTheSolve(self):
        self.filled()
        checkpoint = self.state / "checkpoint"
        sound = checkpoint.read_bytes()
        for content in (sound[:1000], sound[:-1] + bytes([sound[-1] ^ 1]), b"", sound.replace(b"1\n", b"9\n", 1)):
            checkpoint.write_bytes(content)
            server = self.keeper()
            self.assertIn(str(checkpoint), server.log())
            self.assertIn("begins anew", server.log())
            self.assertIn("revision 4", server.log())
            server.kill()

    def test_aFolderInUseIsNamed(self):
        self.keeper()
        line = self.refused(self.scene, "--state", self.state, expect=1)
        self.assertIn(str(self.state / "lock"), line)
        self.assertIn("another radiosityd", line)


@unittest.skipUnless(os.geteuid() == 0, "only root can make a small disk")
class SmallDiskTest(StateCase):
    """A real file system of 4 MiB, which then is full, or can no longer be written."""

    def setUp(self):
        super().setUp()
        self.disk = self.folder / "disk"
        self.disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", self.disk], check=False,
                                 capture_output=True)
        if mounted.returncode != 0:
            self.skipTest("this root may not mount a file system")
        self.addCleanup(subprocess.run, ["umount", "-l", self.disk], check=False)
        self.state = self.disk / "state"

    def fill(self):
        with open(self.disk / "ballast", "wb", buffering=0) as file:
            try:
                while True:
                    file.write(b"x" * 4096)
            except OSError:
                pass

    async def long_edit(self, session, nits):
        """Of more than a page or two: room that is left in the log does not do."""
        return await session.call("scene.patch", patch=brighter(nits) + [
            {"op": "replace", "path": "/extras/w0", "value": "x" * 50000}])

    def test_aFullDiskRefusesEditsAndServerAndViewersLiveOn(self):
        server = self.keeper()

        async def body():
            session, viewer = await Session.open(server.url), await Session.open(server.url)
            await viewer.call("subscribe")
            kept = await session.call("scene.patch", patch=brighter(20))
            await session.call("solve.wait", timeoutMs=60000)
            self.fill()
            for _ in range(3):
                with self.assertRaises(RpcError) as refused:
                    await self.long_edit(session, 30)
                self.assertEqual(refused.exception.code, UNAVAILABLE)
                self.assertIn(str(self.state / "state.sqlite"), str(refused.exception))
            with self.assertRaises(urllib.error.HTTPError) as upload:
                self.put(server.url, "/uploads", os.urandom(100000))
            self.assertEqual(upload.exception.code, 503)
            status = await viewer.call("status")
            self.assertEqual((status["revision"], status["state"]), (kept["revision"], "converged"))
            (self.disk / "ballast").unlink()
            self.assertEqual((await self.long_edit(session, 40))["revision"], kept["revision"] + 1)
            self.assertEqual((await viewer.note("scene.patched"))["params"]["revision"], kept["revision"])
            self.assertEqual((await viewer.note("scene.patched"))["params"]["revision"], kept["revision"] + 1)
            return kept["revision"] + 1

        revision = self.run_async(body())
        server.kill()
        server = self.keeper()
        self.assertIn(f"revision {revision}", server.log())

    def test_aDiskThatCannotBeWrittenIsNamed(self):
        server = self.keeper()
        self.assertEqual(server.terminate(), 0)
        subprocess.run(["mount", "-o", "remount,ro", self.disk], check=True)
        line = self.refused(self.scene, "--state", self.state, expect=1)
        self.assertIn(str(self.state), line)
        self.assertIn("Read-only", line)


if __name__ == "__main__":
    unittest.main()
