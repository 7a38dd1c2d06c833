"""Renderer processes that are killed or stopped while somebody watches: nobody is disconnected, and the light that comes
out has the same bits as that of a solve that was left alone."""
import asyncio
import os
import pathlib
import signal
import unittest
import urllib.error
import urllib.request

from harness import ServiceCase
from wire import Session

SETTINGS = ("--error", "0.01", "--texels", "6000", "--workers", "2")
SECONDS = 400  # on a machine that others use too; a stopped renderer alone takes half a minute to be given up


class Renderers(ServiceCase):
    undisturbed = None

    def setUp(self):
        super().setUp()
        self.room = pathlib.Path(os.environ["RADIOSITY_ROOM"])
        if not self.room.exists():
            self.fail(f"{self.room} is missing: build test_scenes first")

    def workers(self, server):
        """Numbers of the server's renderer processes."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and b"--worker" in (entry / "cmdline").read_bytes():
                    stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                    if int(stat[1]) == server.process.pid and stat[0] != "Z":
                        found.append(int(entry.name))
            except OSError:
                continue  # it has ended
        return sorted(found)

    def light(self, server):
        with urllib.request.urlopen(server.url + "/lightmaps/0.exr", timeout=60) as reply:
            return reply.read()

    async def solving(self, session):
        """Until some shots are shot."""
        while True:
            status = await session.call("status")
            self.assertIn(status["state"], ("loading", "solving", "empty"), "the solve ended before it could be disturbed")
            if status["state"] == "solving" and status["shots"] > 100:
                return
            await asyncio.sleep(0.01)

    async def converged(self, session):
        while (status := await session.call("status"))["state"] in ("loading", "solving", "empty"):
            await asyncio.sleep(0.05)
        self.assertEqual(status["state"], "converged", status)
        return status

    def disturbed(self, disturb):
        """Light and session after a solve during which `disturb(server, session)` did its work."""
        server = self.server(self.room, *SETTINGS)

        async def body():
            session = await Session.open(server.url)
            await session.call("subscribe")
            if disturb:
                await self.solving(session)
                await disturb(server, session)
            status = await self.converged(session)
            # The same connection, to the end: it still streams.
            await session.tiles_until(status["tileVersion"])
            self.assertFalse(session.socket.closed)
            await session.close()
            return session

        session = asyncio.run(asyncio.wait_for(body(), SECONDS))
        return self.light(server), session, server

    def expected(self):
        """The light of a solve that is left alone, once for all tests."""
        if Renderers.undisturbed is None:
            Renderers.undisturbed = self.disturbed(None)[0]
        return Renderers.undisturbed

    def readiness(self, server):
        try:
            with urllib.request.urlopen(server.url + "/readyz", timeout=60) as reply:
                return reply.read().decode()
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.read().decode()

    def metric(self, server, name):
        with urllib.request.urlopen(server.url + "/metrics", timeout=60) as reply:
            lines = reply.read().decode().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith(f"radiosityd_{name} "))

    def test_a_renderer_that_is_killed_is_replaced(self):
        async def kill(server, session):
            os.kill(self.workers(server)[0], signal.SIGKILL)
            note = (await session.note("notice"))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("signal 9", note["text"])

        light, _, server = self.disturbed(kill)
        self.assertEqual(light, self.expected())
        self.assertEqual(self.metric(server, "renderers_replaced_total"), 1)
        self.assertEqual(len(self.workers(server)), 2)

    def test_a_renderer_that_hangs_is_given_up_and_replaced(self):
        async def stop(server, session):
            stopped = self.workers(server)[1]
            os.kill(stopped, signal.SIGSTOP)
            note = (await session.note("notice"))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("hangs", note["text"])
            self.assertNotIn(stopped, self.workers(server))

        light, _, _ = self.disturbed(stop)
        self.assertEqual(light, self.expected())

    def test_when_all_renderers_are_lost_again_and_again_the_solve_starts_over(self):
        async def massacre(server, session):
            while "no renderer" not in await asyncio.to_thread(self.readiness, server):
                for worker in self.workers(server):
                    try:
                        os.kill(worker, signal.SIGKILL)
                    except ProcessLookupError:
                        pass
            while (await session.note("notice"))["params"]["kind"] != "solveRestarted":
                pass

        light, _, server = self.disturbed(massacre)
        self.assertEqual(light, self.expected())
        self.assertGreaterEqual(self.metric(server, "solve_restarts_total"), 1)
        self.assertEqual(self.metric(server, "renderer_lost"), 0)


if __name__ == "__main__":
    unittest.main()
