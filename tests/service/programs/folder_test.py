"""The folder of `--state` while a server has it open: moved away, removed, replaced, or limited by `ulimit -f`."""
import os
import resource
import shutil
import subprocess
import time
import unittest
import urllib.error
import urllib.request

from harness import MARK, program
from patience import PATIENCE
from state_test import UNAVAILABLE, StateCase, brighter
from wire import RpcError, Session


class MovedFolderTest(StateCase):
    """The folder goes while a server has it open: nothing is acknowledged that the next start would not find."""

    def ready(self, server):
        try:
            with urllib.request.urlopen(server.url + "/readyz", timeout=60 * PATIENCE) as reply:
                return reply.status, reply.read().decode()
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, refused.read().decode()

    def until(self, holds):
        deadline = time.monotonic() + 60 * PATIENCE
        while not holds():
            self.assertLess(time.monotonic(), deadline, "it never came")
            time.sleep(0.02)

    def loaded(self, server):
        """SCENE is loaded, and kept, after the port is open."""
        async def wait():
            await (await Session.open(server.url)).call("solve.wait", timeoutMs=60000)

        self.run_async(wait())
        return server

    async def refusedEdit(self, session):
        with self.assertRaises(RpcError) as refused:
            await session.call("scene.patch", patch=brighter(30), requestId="again")
        self.assertEqual(refused.exception.code, UNAVAILABLE)
        self.assertIn(str(self.state), str(refused.exception))

    def test_editsAreRefusedUntilTheFolderIsBack(self):
        server, away = self.keeper(), self.folder / "away"

        async def body():
            session = await Session.open(server.url)
            kept = await session.call("scene.patch", patch=brighter(20))
            await session.call("solve.wait", timeoutMs=60000)
            self.state.rename(away)
            for _ in range(3):
                await self.refusedEdit(session)
            with self.assertRaises(urllib.error.HTTPError) as upload:
                self.put(server.url, "/uploads", b"upload")
            with upload.exception as reply:
                self.assertEqual(reply.code, 503)
            self.until(lambda: self.ready(server)[0] == 503)
            self.assertIn(f"edits are refused: {self.state}", self.ready(server)[1])
            self.assertEqual((await session.call("status"))["revision"], kept["revision"])
            away.rename(self.state)
            again = await session.call("scene.patch", patch=brighter(30), requestId="again")
            self.assertEqual(again["revision"], kept["revision"] + 1)
            self.until(lambda: self.ready(server) == (200, "ready\n"))
            return again["revision"]

        revision = self.run_async(body())
        server.kill()
        self.assertIn(f"revision {revision}", self.keeper().log())

    def test_aSecondServerAtThePathIsToldOfTheFirst(self):
        first, away = self.loaded(self.keeper()), self.folder / "away"
        self.state.rename(away)
        second = self.keeper()
        self.assertIn(f"another radiosityd (process {first.process.pid})", second.log())

        async def edit(server):
            return await (await Session.open(server.url)).call("scene.patch", patch=brighter(40))

        async def refused(server):
            await self.refusedEdit(await Session.open(server.url))

        self.run_async(refused(first))
        self.assertEqual(self.run_async(edit(second))["revision"], 2)
        self.assertEqual(first.terminate(), 0, first.log())  # which leaves the other's files alone
        self.assertEqual(self.run_async(edit(second))["revision"], 3)
        second.kill()
        self.assertIn("revision 3", self.keeper().log())

    def test_aRemovedFolderIsNoLongerWrittenTo(self):
        server = self.loaded(self.keeper())
        shutil.rmtree(self.state)

        async def body():
            await self.refusedEdit(await Session.open(server.url))

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())
        self.assertFalse((self.state / "state.sqlite").exists())


class FileSizeTest(StateCase):
    """`ulimit -f`: a write that goes too far fails, and the program lives on."""

    def limit(self, process, size):
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    def test_anEditThatMakesAFileTooLargeIsRefusedAndTheServerLivesOn(self):
        server = self.keeper()

        async def body():
            session = await Session.open(server.url)
            kept = await session.call("scene.patch", patch=brighter(20))
            await session.call("solve.wait", timeoutMs=60000)
            self.limit(server.process, (self.state / "state.sqlite-wal").stat().st_size)
            with self.assertRaises(RpcError) as refused:
                await session.call("scene.patch", patch=brighter(30) + [
                    {"op": "replace", "path": "/extras/w0", "value": "x" * 50000}])
            self.assertEqual(refused.exception.code, UNAVAILABLE)
            self.assertIn("File too large", str(refused.exception))
            self.limit(server.process, resource.RLIM_INFINITY)
            self.assertEqual((await session.call("scene.patch", patch=brighter(40)))["revision"], kept["revision"] + 1)

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())

    def test_anOutputThatMakesAFileTooLargeIsAnErrorOfTheClient(self):
        server = self.keeper()
        done = subprocess.run(
            ["sh", "-c", 'ulimit -S -f 4; exec "$@"', "sh", program("RADIOSITY"), "solve", self.scene, "-o", "lit.glb",
             "--server", server.url, "--error", "0.5"], capture_output=True, text=True, timeout=300 * PATIENCE,
            check=False, cwd=self.folder, env={**os.environ, MARK: self.mark})
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("File too large", done.stderr)
        self.assertFalse((self.folder / "lit.glb").exists())


if __name__ == "__main__":
    unittest.main()
