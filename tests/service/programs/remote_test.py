"""The client's other commands against a server that runs already."""
import asyncio
import base64
import contextlib
import hashlib
import json
import re
import signal
import struct
import unittest
import urllib.request
import uuid
from http import HTTPStatus

import websockets

import plates
from harness import ServiceCase, waitForLine
from pictures import brightness
from stand_in import Frames, example, messages, running

EDIT = json.dumps([{"op": "replace", "path": f"/materials/{plates.LAMP_MATERIAL}/emissiveFactor", "value": [1, 1, 1]}])
QUICK = ("--error", 0.05, "--texels", 2000)


class RemoteTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.document())

    def solved(self, *arguments):
        """A server that has solved the scene; the client did it."""
        server = self.server(*arguments)
        self.client("solve", self.scene, "-o", "lit.glb", "--server", server.url, *QUICK)
        return server

    def test_solveOnAServerLeavesItRunning(self):
        server = self.solved()
        self.assertIsNone(server.process.poll())
        status = json.loads(self.client("status", server.url, "--json")[0])
        self.assertEqual(status["state"], "converged")
        self.assertIn("plates.glb", self.files())
        self.assertIn("lit.lightmap.0.exr", self.files())

    def test_everyFormOfAddressIsUnderstood(self):
        server = self.server()
        for url in (f"127.0.0.1:{server.port}", f"http://127.0.0.1:{server.port}/", f"ws://127.0.0.1:{server.port}/ws"):
            self.assertIn("state", self.client("status", url)[0])

    def test_gltfWithExternalFilesIsPackedForTheServer(self):
        server = self.server()
        plates.write_gltf(self.folder / "room.gltf", plates.document(), "my data.bin")
        out, _ = self.client("load", server.url, "room.gltf")
        self.assertRegex(out, r"^revision \d+\n$")

    def test_editPrintsRevisionAndWhatItAffects(self):
        server = self.solved()
        before = json.loads(self.client("status", server.url, "--json")[0])["revision"]
        dry, _ = self.client("edit", server.url, "-", "--dry-run", stdin=EDIT)
        self.assertIn("dry run", dry)
        self.assertEqual(json.loads(self.client("status", server.url, "--json")[0])["revision"], before)
        (self.folder / "patch.json").write_text(EDIT)
        out, _ = self.client("edit", server.url, "patch.json", "--base-revision", before)
        self.assertRegex(out, rf"^revision {before + 1}, affected: \d+ surfaces, \d+ shots\n$")
        self.assertIn("revision", self.complaint("edit", server.url, "patch.json", "--base-revision", before))

    @staticmethod
    def goneForSeconds(requests, comes_back_anew):
        """A stand-in that takes an undo, appends its id to `requests`, and goes without an answer; it is back three
        seconds later, at the same address."""
        replies = {method: example(f"reply-{method}")["result"] for method in ("hello", "scene.undo")}

        async def stand_in(told):
            gone = asyncio.Event()

            async def serve(socket, *_):
                await socket.send(json.dumps(example("note-serverInfo")))
                async for text in messages(socket):
                    call = json.loads(text)
                    if call["method"] == "scene.undo":
                        requests.append(call["params"]["requestId"])
                        if len(requests) == 1:
                            return gone.set()
                    await socket.send(json.dumps({"jsonrpc": "2.0", "id": call["id"], "result": replies[call["method"]]}))
                return None

            protocols = {"subprotocols": ["radiosity.v1"]}
            async with websockets.serve(serve, "127.0.0.1", 0, **protocols) as server:
                port = server.sockets[0].getsockname()[1]
                told.set_result(port)
                await gone.wait()
            await asyncio.sleep(3)
            if comes_back_anew:
                replies["hello"] = {**replies["hello"], "epoch": str(uuid.uuid4())}
            async with websockets.serve(serve, "127.0.0.1", port, **protocols):
                await asyncio.sleep(60)

        return stand_in

    def test_anEditIsSentAgainToAServerThatIsAwayForSeconds(self):
        requests = []
        with running(self.goneForSeconds(requests, False)) as port:
            out, err = self.client("undo", f"127.0.0.1:{port}")
        self.assertIn("took back revision", out)
        self.assertIn("sending the edit again", err)
        self.assertEqual(len(requests), 2)
        self.assertEqual(requests[0], requests[1])

    def test_anEditIsNotSentAgainToAServerThatBeganAnew(self):
        """Another process without a state, perhaps with another scene: what it is asked would be done again, or there."""
        requests = []
        with running(self.goneForSeconds(requests, True)) as port:
            err = self.complaint("undo", f"127.0.0.1:{port}", expect=1)
        self.assertIn("began anew", err)
        self.assertEqual(len(requests), 1)

    def test_aSceneThatTakesLongToLoadDoesNotCostTheConnection(self):
        """A server lets go who does not answer its pings, and while a scene is uploaded and read nothing else is said."""
        ponged = []

        async def stand_in(told):
            answered = asyncio.Event()

            async def websocket(frames):
                frames.send(1, json.dumps(example("note-serverInfo")).encode())
                while True:
                    opcode, payload = await frames.receive()
                    if opcode == 1:
                        call = json.loads(payload)
                        result = example(f"reply-{call['method']}")["result"]
                        frames.send(1, json.dumps({"jsonrpc": "2.0", "id": call["id"], "result": result}).encode())
                    elif opcode == 10:
                        ponged.append(payload)
                        answered.set()

            async def serve(reader, writer):
                with contextlib.suppress(asyncio.IncompleteReadError):
                    head = (await reader.readuntil(b"\r\n\r\n")).decode()
                    key = re.search(r"Sec-WebSocket-Key: (\S+)", head, re.IGNORECASE)
                    if key:
                        accept = hashlib.sha1((key.group(1) + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest()
                        writer.write(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                                     b"Sec-WebSocket-Protocol: radiosity.v1\r\nSec-WebSocket-Accept: "
                                     + base64.b64encode(accept) + b"\r\n\r\n")
                        connected.append(Frames(reader, writer))
                        return await websocket(connected[0])
                    await reader.readexactly(int(re.search(r"Content-Length: (\d+)", head, re.IGNORECASE).group(1)))
                    connected[0].send(9, b"still there?")
                    with contextlib.suppress(asyncio.TimeoutError):
                        await asyncio.wait_for(answered.wait(), 60)
                    body = json.dumps({"error": {"code": "busy", "message": "that was all"}}).encode()
                    writer.write(b"HTTP/1.1 503 Busy\r\nConnection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
                writer.close()

            connected = []
            async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
                told.set_result(server.sockets[0].getsockname()[1])
                await asyncio.sleep(300)

        with running(stand_in) as port:
            self.assertIn("that was all", self.complaint("solve", self.scene, "-o", "lit.glb", "--server",
                                                         f"127.0.0.1:{port}", expect=1))
        self.assertEqual(ponged, [b"still there?"])

    def test_badEditsExit2WithOperationPointerAndReason(self):
        server = self.solved()
        line = self.complaint("edit", server.url, "-", stdin='[{"op":"replace","path":"/materials/99/name","value":1}]')
        self.assertIn("operation 0", line)
        self.assertIn("/materials/99", line)
        self.assertIn("standard input", self.complaint("edit", server.url, "-", stdin='[{"op":'))
        self.assertIn("no such file", self.complaint("edit", server.url, "gone.json"))

    def test_snapshotWritesAPicture(self):
        server = self.solved()
        for extra in ((), ("--camera", "front"), *(("--quantity", quantity) for quantity in ("irradiance", "unshot", "error", "mipLevel", "normal"))):
            self.client("snapshot", server.url, "-o", "a.png", "--width", 64, "--height", 48, *extra)
            png = (self.folder / "a.png").read_bytes()
            self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
            self.assertEqual(struct.unpack(">2I", png[16:24]), (64, 48))
        _, told = self.client("snapshot", server.url, "-o", "a.png")
        exposure = float(re.search(r"^exposure (\S+) per nit$", told, re.MULTILINE).group(1))
        for name, factor in (("same.png", 1), ("dark.png", 1e-6), ("bright.png", 1e6)):
            _, told = self.client("snapshot", server.url, "-o", name, "--exposure", exposure * factor)
            self.assertIn(f"exposure {exposure * factor:.6g} per nit", told)
        dark, same, bright = (brightness((self.folder / name).read_bytes()) for name in ("dark.png", "same.png", "bright.png"))
        self.assertAlmostEqual(brightness((self.folder / "a.png").read_bytes()), same, delta=0.01)  # told in 6 digits
        self.assertEqual(dark, 0)
        self.assertGreater(bright, 1.5 * same)
        for wrong in ("0", "-1", "nan", "1e31", "bright"):
            self.assertIn("--exposure", self.complaint("snapshot", server.url, "-o", "b.png", "--exposure", wrong))
        self.assertIn("nosuch", self.complaint("snapshot", server.url, "-o", "b.png", "--camera", "nosuch"))
        self.assertNotIn("b.png", self.files())

    def test_texelTellsLuxAndItsErrorOrWhichArgumentIsWrong(self):
        server = self.solved()
        found = [self.client("texel", server.url, 0, x, x)[0] for x in (2, 3)]
        for text in found:
            lux, error = map(float, re.match(r"(\S+) \+- (\S+) lux\nR ", text).groups())
            self.assertGreater(lux, 0)
            self.assertTrue(0 < error < lux, text)
        self.assertIn("/params/page", self.complaint("texel", server.url, 99, 0, 0))
        self.assertIn("/params/x", self.complaint("texel", server.url, 0, 4294967295, 0))
        self.assertIn("PAGE", self.complaint("texel", server.url, "x", 0, 0))

    def test_saveWritesSceneAndLightmaps(self):
        server = self.solved()
        out, _ = self.client("save", server.url, "-o", "again.glb", "--error-map")
        self.assertEqual(out.splitlines(), ["again.glb", "again.lightmap.0.exr", "again.error.0.exr"])
        for ending in (".glb", ".lightmap.0.exr"):
            self.assertEqual((self.folder / f"again{ending}").read_bytes(), (self.folder / f"lit{ending}").read_bytes())

    def savedFrom(self, status, fetched):
        """What `radiosity save` writes of a stand-in; `status` fills in its answers, and its files tell its texels."""
        async def serve(socket, *_):
            await socket.send(json.dumps(example("note-serverInfo")))
            async for text in messages(socket):
                call = json.loads(text)
                result = example(f"reply-{call['method']}")["result"]
                if call["method"] == "status":
                    status(result)
                await socket.send(json.dumps({"jsonrpc": "2.0", "id": call["id"], "result": result}))

        async def answer(path, _):
            if path == "/ws":
                return None
            if "/lightmaps/1" in path:
                return HTTPStatus.NOT_FOUND, [], b""
            body = f"{path} of {fetched(path)} texels".encode()
            return HTTPStatus.OK, [], body

        async def stand_in(told):
            async with websockets.serve(serve, "127.0.0.1", 0, subprotocols=["radiosity.v1"], process_request=answer) as server:
                told.set_result(server.sockets[0].getsockname()[1])
                await asyncio.sleep(60)

        with running(stand_in) as port:
            self.client("save", f"127.0.0.1:{port}", "-o", "torn.glb")
        return [(self.folder / file).read_bytes() for file in ("torn.glb", "torn.lightmap.0.exr")]

    def test_saveTakesUVsAndPagesOfOneLayoutOnly(self):
        """Texels are changed by somebody just after the scene was fetched, at the same revision."""
        scenes = []

        def texels():
            return 4000 if scenes else 2000

        def fetched(path):
            now = texels()
            scenes.extend([path] if path == "/scene.glb" else [])
            return now

        for file in self.savedFrom(lambda result: result["settings"].update(texels=texels()), fetched):
            self.assertIn(b"of 4000 texels", file)
        self.assertEqual(len(scenes), 2)

    def test_saveWaitsUntilAllTexelsAreThere(self):
        """While a scene is loaded fewer texels are shown, at the revision and with the settings of the whole."""
        asked = []

        def status(result):
            asked.append(None)
            result["state"] = "loading" if len(asked) < 3 else "converged"

        for file in self.savedFrom(status, lambda _: 15000000 if len(asked) >= 3 else 100000):
            self.assertIn(b"of 15000000 texels", file)

    def test_watchEndsWhenTheSolveHasConverged(self):
        server = self.solved()
        out, _ = self.client("watch", server.url)
        self.assertTrue(out.startswith("converged: error "), out)

    def test_watchComesBackAfterTheServerHasRestarted(self):
        server = self.solved()
        watching = self.start("watch", server.url, "--follow")
        waitForLine(watching.stderr, "shots")
        server.terminate()
        waitForLine(watching.stderr, "trying again")
        self.server(port=server.port)
        waitForLine(watching.stderr, "empty")
        watching.send_signal(signal.SIGINT)
        self.assertEqual(watching.wait(60), 75)

    def test_watchTellsWhoHasLoadedAnotherScene(self):
        server = self.solved()
        watching = self.start("watch", server.url, "--follow")
        waitForLine(watching.stderr, "shots")
        scene = self.scene.read_bytes()
        for query, said in (("?name=room.glb&client=Ann", "room.glb loaded by Ann"),
                            ("?client=Ben%0ABo", "unnamed scene loaded by Ben Bo")):
            request = urllib.request.Request(f"{server.url}/scene{query}", scene, {"Content-Type": "model/gltf-binary"}, method="PUT")
            urllib.request.urlopen(request).close()
            waitForLine(watching.stderr, said)
        watching.send_signal(signal.SIGINT)
        self.assertEqual(watching.wait(60), 75)

    def test_tokenIsNeededAndSuffices(self):
        (self.folder / "token").write_text("a-long-enough-token-for-a-test\n")
        (self.folder / "wrong").write_text("another-long-enough-token\n")
        server = self.server("--token-file", self.folder / "token")
        self.assertIn("state", self.client("status", server.url, "--token-file", "token")[0])
        self.assertIn("token", self.complaint("status", server.url, expect=1))
        self.assertIn("token", self.complaint("load", server.url, self.scene, "--token-file", "wrong", expect=1))

    def test_nobodyListeningIsSaidPlainly(self):
        server = self.server()
        server.terminate()
        for command in (("status", server.url), ("watch", server.url), ("load", server.url, self.scene),
                        ("save", server.url, "-o", "a.glb"), ("snapshot", server.url, "-o", "a.png")):
            with self.subTest(command=command[0]):
                self.assertIn("connection refused", self.complaint(*command, expect=1))
        self.assertEqual(self.files(), ["plates.glb"])

    def test_emptyServerHasNothingToSave(self):
        server = self.server()
        self.assertIn("no scene", self.complaint("save", server.url, "-o", "a.glb"))


if __name__ == "__main__":
    unittest.main()
