"""Renderer processes that are killed or stopped, or lose their graphics contexts, while somebody watches: nobody is
disconnected, and the light that comes out has the same bits as that of a solve that was left alone."""
import asyncio
import os
import pathlib
import signal
import time
import unittest
import urllib.error
import urllib.request

from harness import ServiceCase, program
from patience import PATIENCE
from wire import Session

# Long enough that nobody is too late to disturb it: seconds where nothing else runs. Under a sanitizer, where all is slower,
# a third of the shots is long enough.
SETTINGS = ("--error", "0.005" if PATIENCE == 1 else "0.01", "--texels", "6000", "--workers", "2")
# On a machine that others use too. A renderer that stops while it draws is given up after half a minute, or a whole one:
# it is given as long again if it had used the processor.
SECONDS = 400 * PATIENCE


class Renderers(ServiceCase):
    undisturbed = None

    def setUp(self):
        super().setUp()
        self.room = pathlib.Path(os.environ["RADIOSITY_ROOM"])
        if not self.room.exists():
            self.fail(f"{self.room} is missing: build test_scenes first")

    def faulty(self):
        """Environment of a server whose graphics contexts fail when fault() says so."""
        (self.folder / "faults").mkdir(exist_ok=True)
        return {"LD_PRELOAD": program("GL_FAULTS"), "RADIOSITY_TEST_GL_FAULTS": str(self.folder / "faults"),
                "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"}

    def fault(self, name):
        """See gl_faults.cpp. Returns the file, which goes when somebody has the fault."""
        file = self.folder / "faults" / name
        file.touch()
        return file

    def light(self, server):
        with urllib.request.urlopen(server.url + "/lightmaps/0.exr", timeout=60 * PATIENCE) as reply:
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
        server = self.server(self.room, *SETTINGS, env=self.faulty())

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
            with urllib.request.urlopen(server.url + "/readyz", timeout=60 * PATIENCE) as reply:
                return reply.read().decode()
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.read().decode()

    def metric(self, server, name):
        with urllib.request.urlopen(server.url + "/metrics", timeout=60 * PATIENCE) as reply:
            lines = reply.read().decode().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith(f"radiosityd_{name} "))

    def test_a_renderer_that_is_killed_is_replaced(self):
        async def kill(server, session):
            os.kill(server.workers()[0], signal.SIGKILL)
            note = (await session.note("notice", SECONDS))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("signal 9", note["text"])

        light, _, server = self.disturbed(kill)
        self.assertEqual(light, self.expected())
        self.assertEqual(self.metric(server, "renderers_replaced_total"), 1)
        self.assertEqual(len(server.workers()), 2)

    def test_idle_renderers_that_are_killed_are_replaced_at_once_and_told_of_meanwhile(self):
        server = self.server(self.room, "--error", "0.5", "--texels", "500", "--workers", "2")
        self.until(lambda: self.metric(server, 'solve_state{state="converged"}') == 1)
        before, light, said = server.workers(), self.light(server), set()
        for worker in before:
            os.kill(worker, signal.SIGKILL)
        killed = time.monotonic()
        # A renderer is counted as soon as its death is found, and ready once another has started.
        while self.metric(server, "renderers_replaced_total") < 2 or self.readiness(server) != "ready\n":
            said.add(self.readiness(server))
            self.assertLess(time.monotonic() - killed, SECONDS, "they were never replaced")
        if PATIENCE == 1:
            self.assertLess(time.monotonic() - killed, 10)  # a second where nothing else runs
        # Which of the two texts is told goes by whether both are found at once.
        missing = [text for text in said if "no renderer" in text or "being replaced" in text]
        self.assertTrue(any("signal 9" in text for text in missing), said)
        self.assertEqual(self.metric(server, "renderers_missing"), 0)
        self.assertEqual(len(set(server.workers()) - set(before)), 2)
        self.assertEqual(self.light(server), light)

    def test_a_renderer_that_hangs_is_given_up_and_replaced(self):
        async def stop(server, session):
            stopped = server.workers()[1]
            os.kill(stopped, signal.SIGSTOP)
            note = (await session.note("notice", SECONDS))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("hangs", note["text"])
            self.assertNotIn(stopped, server.workers())

        light, _, _ = self.disturbed(stop)
        self.assertEqual(light, self.expected())

    def test_when_all_renderers_are_lost_again_and_again_the_solve_starts_over(self):
        async def massacre(server, session):
            while "no renderer" not in await asyncio.to_thread(self.readiness, server):
                for worker in server.workers():
                    try:
                        os.kill(worker, signal.SIGKILL)
                    except ProcessLookupError:
                        pass
            while (await session.note("notice", SECONDS))["params"]["kind"] != "solveRestarted":
                pass

        light, _, server = self.disturbed(massacre)
        self.assertEqual(light, self.expected())
        self.assertGreaterEqual(self.metric(server, "solve_restarts_total"), 1)
        self.assertEqual(self.metric(server, "renderer_lost"), 0)

    def test_a_renderer_that_loses_its_graphics_context_is_replaced(self):
        async def lose(server, session):
            before, fault = server.workers(), self.fault("worker-reset.0")
            note = (await session.note("notice", SECONDS))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("the graphics context was lost", note["text"])
            self.assertFalse(fault.exists())
            self.assertEqual(len(set(before) - set(server.workers())), 1)

        light, _, server = self.disturbed(lose)
        self.assertEqual(light, self.expected())
        self.assertEqual(self.metric(server, "renderers_replaced_total"), 1)

    def test_a_renderer_whose_driver_is_out_of_memory_is_replaced(self):
        async def exhaust(_, session):
            self.fault("worker-memory.0")
            note = (await session.note("notice", SECONDS))["params"]
            self.assertEqual(note["kind"], "rendererReplaced")
            self.assertIn("out of memory", note["text"])

        light, _, _ = self.disturbed(exhaust)
        self.assertEqual(light, self.expected())

    def test_when_every_graphics_context_is_lost_the_solve_starts_over_on_new_ones(self):
        async def reset(server, session):
            fault = self.fault("worker-reset")
            while "the graphics context was lost" not in (readiness := await asyncio.to_thread(self.readiness, server)):
                await asyncio.sleep(0.01)
            self.assertIn("no renderer", readiness)
            fault.unlink()
            while (note := (await session.note("notice", SECONDS))["params"])["kind"] != "solveRestarted":
                pass
            self.assertIn("the graphics context was lost", note["text"])

        light, _, server = self.disturbed(reset)
        self.assertEqual(light, self.expected())
        self.assertGreaterEqual(self.metric(server, "solve_restarts_total"), 1)

    def test_a_picture_whose_graphics_context_is_lost_is_drawn_on_a_new_one(self):
        def picture():
            with urllib.request.urlopen(server.url + "/snapshot.png?width=160&height=120", timeout=60 * PATIENCE) as reply:
                return reply.read()

        server = self.server(self.room, "--error", "0.5", "--texels", "500", "--workers", "1", env=self.faulty())
        self.until(lambda: self.metric(server, 'solve_state{state="converged"}') == 1)
        before = picture()
        fault = self.fault("server-reset.0")
        self.assertEqual(picture(), before)
        self.assertFalse(fault.exists())

    def test_a_scene_that_the_card_has_no_memory_for_is_refused_and_the_one_before_stays(self):
        server = self.server(self.room, "--error", "0.5", "--texels", "500", "--workers", "1", env=self.faulty())
        self.until(lambda: self.metric(server, 'solve_state{state="converged"}') == 1)
        before, revision = self.light(server), self.metric(server, "scene_revision")
        faults = [self.fault(f"worker-memory.{n}") for n in range(5)]  # it is tried so often
        request = urllib.request.Request(server.url + "/scene", self.room.read_bytes(), method="PUT",
                                         headers={"Content-Type": "model/gltf-binary"})
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=SECONDS)
        with refused.exception as reply:
            self.assertEqual(reply.code, 503)
            self.assertIn("out of memory", reply.read().decode())
        self.assertEqual([fault for fault in faults if fault.exists()], [])
        self.assertEqual((self.light(server), self.metric(server, "scene_revision")), (before, revision))
        with urllib.request.urlopen(request, timeout=SECONDS) as reply:
            self.assertEqual(reply.status, 200)
        self.until(lambda: self.metric(server, 'solve_state{state="converged"}') == 1)
        self.assertEqual(self.light(server), before)

    def until(self, holds):
        deadline = time.monotonic() + SECONDS
        while not holds():
            self.assertLess(time.monotonic(), deadline, "it never came")
            time.sleep(0.05)


if __name__ == "__main__":
    unittest.main()
