"""The server's end while it is at work. No claim about seconds: what must hold is that the end comes (a hang is caught
by the harness's 20 s), with status 0, the promised words to the clients, and no process left."""
import asyncio
import os
import signal
import struct
import unittest

import websockets

import plates
from harness import ServiceCase, marked_processes, program
from patience import PATIENCE
from wire import Session

ENDLESS = ("--error", 1e-6, "--texels", 20000, "--workers", 2)


def grid_document(cells):
    """A floor of cells x cells quads: some seconds to load."""
    side = cells + 1
    positions = b"".join(struct.pack("<3f", x / cells, 0.01 * ((x + z) % 2), z / cells)
                         for z in range(side) for x in range(side))
    indices = b"".join(struct.pack("<6I", a, a + side, a + side + 1, a, a + side + 1, a + 1)
                       for z in range(cells) for a in range(z * side, z * side + cells))
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "count": side * side, "componentType": 5126, "type": "VEC3", "min": [0, 0, 0],
             "max": [1, 0.01, 1]},
            {"bufferView": 1, "count": 6 * cells * cells, "componentType": 5125, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(positions)},
                        {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)}],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }, positions + indices


class ShutdownTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.lit_document())

    def run_async(self, coroutine):
        return asyncio.run(asyncio.wait_for(coroutine, 400 * PATIENCE))

    async def state_reached(self, session, wanted):
        while (await session.call("status"))["state"] != wanted:
            await asyncio.sleep(0.02)

    def test_solvingServerSaysGoodbyeAndIsGoneWithItsWorkers(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            server = self.server(self.scene, *ENDLESS)

            async def body():
                session = await Session.open(server.url)
                await self.state_reached(session, "solving")
                self.assertEqual(len(server.workers()), 2)
                server.process.send_signal(number)
                self.assertIn("graceMs", (await session.note("draining"))["params"])
                with self.assertRaises(websockets.ConnectionClosed):
                    while True:
                        await session.receive()
                self.assertEqual(session.socket.close_code, 1001)

            self.run_async(body())
            self.assertEqual(server.wait(60), 0, server.log())
            self.assertEqual(marked_processes(self.mark), [])

    def test_solvingServerNeedsNoClientToEnd(self):
        server = self.server(self.scene, *ENDLESS)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "solving")
            await session.close()

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())
        self.assertEqual(marked_processes(self.mark), [])

    def test_hungWorkersDoNotKeepTheServer(self):
        server = self.server(self.scene, *ENDLESS)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "solving")
            for worker in server.workers():
                os.kill(worker, signal.SIGSTOP)
            await asyncio.sleep(0.5)  # they owe an answer by now
            await session.close()

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())
        self.assertEqual(marked_processes(self.mark), [])

    def test_loadingServerEnds(self):
        document, buffer = grid_document(400)
        plates.write_glb(self.folder / "grid.glb", document, buffer)
        server = self.server(self.folder / "grid.glb", *ENDLESS)

        async def body():
            session = await Session.open(server.url)
            while (await session.call("status"))["state"] == "empty":
                await asyncio.sleep(0.005)
            await session.close()

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())
        self.assertNothingLeft()

    def test_aDiskThatDoesNotAnswerDoesNotKeepTheServer(self):
        """An edit, and after it the end, wait for it. What was acknowledged before is there again."""
        stuck, state = self.folder / "stuck", self.folder / "state"
        server = self.server(self.scene, "--state", state, "--error", 0.1, "--texels", 500,
                             env={"LD_PRELOAD": program("STUCK_DISK"), "RADIOSITY_TEST_STUCK_DISK": str(stuck)})
        lamp = f"/materials/{plates.LAMP_MATERIAL}/emissiveFactor"

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            await session.call("scene.patch", patch=[{"op": "replace", "path": lamp, "value": [1, 0, 0]}])
            stuck.touch()
            edit = asyncio.ensure_future(
                session.call("scene.patch", patch=[{"op": "replace", "path": lamp, "value": [0, 1, 0]}]))
            done, _ = await asyncio.wait({edit}, timeout=1)
            self.assertEqual(done, set(), "it was acknowledged before it was on the disk")
            server.process.send_signal(signal.SIGTERM)
            await asyncio.wait({edit})
            self.assertIsNotNone(edit.exception())

        self.run_async(body())
        self.assertEqual(server.wait(60), 0, server.log())
        self.assertIn("the end took too long", server.log())
        stuck.unlink()
        again = self.server("--state", state)

        async def acknowledged():
            session = await Session.open(again.url)
            scene = await session.call("scene.get")
            await session.close()
            return scene["gltf"]["materials"][plates.LAMP_MATERIAL]["emissiveFactor"]

        # The other one was not answered: it may be there or not.
        self.assertIn(self.run_async(acknowledged()), ([1, 0, 0], [0, 1, 0]))

    def test_aSlowEndOfTheProgramIsCutShortWithoutAWord(self):
        """The engine has ended by then, and so has the log: a line about it would be wrong, and written by what is gone."""
        server = self.server(self.scene, "--error", 0.5, "--texels", 500,
                             env={"LD_PRELOAD": program("STUCK_DISK"), "RADIOSITY_TEST_SLOW_EXIT": "1"})

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            await session.close()

        self.run_async(body())
        self.assertEqual(server.terminate(), 0, server.log())
        # Where the machine is slow the engine itself may take longer than it is given: a line before that is true.
        _, _, since_exit = server.log().partition(f"exit of {server.process.pid}\n")
        self.assertNotIn("leaving", since_exit)


if __name__ == "__main__":
    unittest.main()
