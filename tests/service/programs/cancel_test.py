"""Work that ends with its client: loads, pictures, files; and what goes on beside them. Of seconds there are only wide
claims: work that nobody waits for ends long before it would be done."""
import asyncio
import json
import os
import signal
import socket
import time
import unittest
import urllib.request

import websockets

import plates
from harness import ServiceCase
from patience import PATIENCE
from shutdown_test import grid_document
from wire import RpcError, Session

LAMP = f"/materials/{plates.LAMP_MATERIAL}/emissiveFactor"
CANCELLED = -32049
# What is called off ends within a fifth of a second on an idle machine; the pictures below would take minutes there.
SOON = 30.0 * PATIENCE


def cpu_seconds(process):
    with open(f"/proc/{process.pid}/stat", encoding="ascii") as stat:
        fields = stat.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class CancelTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.lit_document())

    def slow(self):
        """Bytes of a scene that takes many seconds to load."""
        if not hasattr(self, "slow_bytes"):
            plates.write_glb(self.folder / "slow.glb", *grid_document(500))
            self.slow_bytes = (self.folder / "slow.glb").read_bytes()
        return self.slow_bytes

    def run_async(self, coroutine):
        return asyncio.run(asyncio.wait_for(coroutine, 400 * PATIENCE))

    def put(self, server, body):
        """A PUT /scene that is not answered yet."""
        connection = socket.create_connection(("127.0.0.1", server.port))
        self.addCleanup(connection.close)
        connection.sendall(f"PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body)
        return connection

    def answer(self, connection):
        """Status and body of what comes on a connection."""
        connection.settimeout(120 * PATIENCE)
        text = b""
        while b"\r\n\r\n" not in text or len(text.split(b"\r\n\r\n", 1)[1]) < self.length(text):
            text += self.some(connection)
        return int(text.split()[1]), json.loads(text.split(b"\r\n\r\n", 1)[1])

    def some(self, connection):
        chunk = connection.recv(4096)
        self.assertNotEqual(chunk, b"", "the connection ended without an answer")
        return chunk

    @staticmethod
    def length(text):
        head = text.split(b"\r\n\r\n", 1)[0].lower()
        return int(head.split(b"content-length:")[1].split()[0])

    async def state_reached(self, session, *wanted):
        while (await session.call("status"))["state"] not in wanted:
            await asyncio.sleep(0.01)

    async def load_seen(self, session):
        """Waits for word that a load is under way, and tells how far it was."""
        while True:
            params = (await session.note("progress"))["params"]
            if params["state"] == "loading" and params.get("fraction", 0) > 0.02:
                return params["fraction"]

    def assertRests(self, server):
        """Nothing is worked at: neither by the server nor for those who have left."""
        deadline = time.monotonic() + SOON
        while True:
            before = cpu_seconds(server.process)
            time.sleep(0.5)
            used = cpu_seconds(server.process) - before
            if used < 0.1:
                return
            self.assertLess(time.monotonic(), deadline, f"{used} s of processor in half a second")

    def test_aLoadEndsWithItsConnection(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            connection = self.put(server, self.slow())
            self.assertLess(await self.load_seen(session), 1)
            self.assertIn("fraction", await session.call("status"))
            begin = time.monotonic()
            connection.close()
            await self.state_reached(session, "converged")
            self.assertLess(time.monotonic() - begin, SOON)
            status = await session.call("status")
            self.assertEqual((status["revision"], "fraction" in status), (1, False))
            await session.close()

        self.run_async(body())
        self.assertRests(server)

    def test_aLoadEndsWithItsSession(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session, loader = await Session.open(server.url), await Session.open(server.url)
            await self.state_reached(session, "converged")
            request = urllib.request.Request(server.url + "/uploads", self.slow(), {"Content-Type": "model/gltf-binary"},
                                             method="PUT")
            url = json.load(urllib.request.urlopen(request))["url"]
            load = asyncio.ensure_future(loader.call("scene.load", url=url))
            await self.load_seen(session)
            loader.socket.transport.abort()  # no farewell
            await self.state_reached(session, "converged")
            self.assertEqual((await session.call("status"))["revision"], 1)
            await asyncio.wait({load})
            load.exception()
            await session.close()

        self.run_async(body())
        self.assertRests(server)

    def test_aLoadEndsWhenAnotherComes(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            first = self.put(server, self.slow())
            await self.load_seen(session)
            second = self.put(server, self.scene.read_bytes())
            status, said = self.answer(first)
            self.assertEqual((status, said["error"]["code"]), (409, "cancelled"))
            self.assertIn("another scene", said["error"]["message"])
            self.assertEqual(self.answer(second), (200, {"revision": 2, "warnings": []}))
            await session.close()

        self.run_async(body())

    def test_aLoadEndsWithTheServer(self):
        server = self.server()

        async def body():
            session = await Session.open(server.url)
            loading = self.put(server, self.slow())
            await self.load_seen(session)
            begin = time.monotonic()
            server.process.send_signal(signal.SIGTERM)
            self.assertEqual(self.answer(loading)[0], 409)
            loading.close()
            await session.close()
            return begin

        begin = self.run_async(body())
        self.assertEqual(server.wait(60), 0, server.log())
        self.assertLess(time.monotonic() - begin, SOON)

    def test_editsAndQuestionsGoOnBesideALoad(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            loading = self.put(server, self.slow())
            await self.load_seen(session)
            for revision, red in ((2, 0.5), (3, 0.25)):
                edited = await session.call("scene.patch", patch=[{"op": "replace", "path": LAMP, "value": [red, 0, 0]}])
                self.assertEqual(edited["revision"], revision)
            self.assertEqual((await session.call("scene.get"))["gltf"]["materials"][plates.LAMP_MATERIAL]["emissiveFactor"],
                             [0.25, 0, 0])
            self.assertEqual((await session.call("status"))["state"], "loading")
            self.assertTrue((await session.call("snapshot", width=64, height=64))["url"])
            self.assertEqual((await session.call("status"))["state"], "loading")
            loading.close()
            await self.state_reached(session, "converged")
            await session.close()

        self.run_async(body())

    def test_picturesOfSomebodyWhoHasLeftKeepNobodyWaiting(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session, gone = await Session.open(server.url), await Session.open(server.url)
            await self.state_reached(session, "converged")
            first = asyncio.ensure_future(gone.call("snapshot", width=4096, height=4096))
            await asyncio.sleep(0.3)
            for request in range(100, 140):  # minutes of work
                await gone.socket.send(json.dumps({"jsonrpc": "2.0", "id": request, "method": "snapshot",
                                                   "params": {"width": 4096, "height": 4096}}))
            edited = await session.call("scene.patch", patch=[{"op": "replace", "path": LAMP, "value": [0.5, 0, 0]}])
            self.assertEqual(edited["revision"], 2)
            self.assertFalse(first.done(), "the edit has waited for the picture")
            gone.socket.transport.abort()
            await asyncio.wait({first})
            first.exception()
            begin = time.monotonic()
            self.assertTrue((await session.call("snapshot", width=64, height=64))["url"])
            self.assertLess(time.monotonic() - begin, SOON, "a picture behind those of somebody who has left")
            await session.close()

        self.run_async(body())
        self.assertRests(server)

    def test_aDownloadThatIsGivenUpEnds(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            connections = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(20)]
            for connection in connections:
                connection.sendall(b"GET /snapshot.png?width=4096&height=4096 HTTP/1.1\r\nHost: localhost\r\n\r\n")
            await asyncio.sleep(0.3)
            for connection in connections:
                connection.close()
            begin = time.monotonic()
            self.assertTrue((await session.call("snapshot", width=64, height=64))["url"])
            self.assertLess(time.monotonic() - begin, SOON)
            await session.close()

        self.run_async(body())
        self.assertRests(server)

    def test_sessionsWithManyPicturesAreServedInTurn(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def ask(session, count):
            for request in range(100, 100 + count):
                await session.socket.send(json.dumps({"jsonrpc": "2.0", "id": request, "method": "snapshot",
                                                      "params": {"width": 800, "height": 800}}))

        async def answers(session, who, order, count):
            while count > 0:
                answer = await session.receive()
                if answer is not None:
                    self.assertIn("result", answer)
                    order.append(who)
                    count -= 1

        async def body():
            many, few = await Session.open(server.url), await Session.open(server.url)
            await self.state_reached(many, "converged")
            order = []
            await ask(many, 16)
            await asyncio.sleep(0.05)
            await ask(few, 3)
            await asyncio.gather(answers(many, "many", order, 16), answers(few, "few", order, 3))
            last = len(order) - 1 - order[::-1].index("few")
            self.assertLess(last, 12, order)  # not behind all of the others
            await many.close()
            await few.close()

        self.run_async(body())

    def test_theEndCallsPicturesOff(self):
        server = self.server(self.scene, "--error", 0.2, "--texels", 500)

        async def body():
            session = await Session.open(server.url)
            await self.state_reached(session, "converged")
            picture = asyncio.ensure_future(session.call("snapshot", width=4096, height=4096))
            await asyncio.sleep(0.3)
            begin = time.monotonic()
            server.process.send_signal(signal.SIGTERM)
            await asyncio.wait({picture})
            error = picture.exception()
            # Where the machine is slow the connection is closed before the picture has noticed.
            self.assertIsInstance(error, (RpcError, websockets.ConnectionClosed))
            self.assertEqual(getattr(error, "code", CANCELLED), CANCELLED if isinstance(error, RpcError) else 1001)
            return begin

        begin = self.run_async(body())
        self.assertEqual(server.wait(60), 0, server.log())
        self.assertLess(time.monotonic() - begin, SOON)


if __name__ == "__main__":
    unittest.main()
