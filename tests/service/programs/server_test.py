"""The server over its socket, by an off-the-shelf WebSocket client that knows only the specification."""
import asyncio
import json
import os
import signal
import subprocess
import unittest
import urllib.error
import urllib.request

import plates
from harness import MARK, ServiceCase, marked_processes, program
from patience import PATIENCE
from wire import RpcError, Session

TARGET = 0.05
SETTINGS = {"targetError": TARGET, "texels": 2000, "seed": 1}
LAMP_EMISSION = f"/materials/{plates.LAMP_MATERIAL}/emissiveFactor"


def doubled(base=None):
    call = {"patch": [{"op": "replace", "path": LAMP_EMISSION, "value": [1.0, 1.0, 1.0]}]}
    return call if base is None else {**call, "baseRevision": base}


class ServerTest(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.document())
        self.running = self.server()
        self.url = self.running.url

    def run_async(self, coroutine):
        return asyncio.run(asyncio.wait_for(coroutine, 600 * PATIENCE))

    def get(self, path):
        with urllib.request.urlopen(self.url + path, timeout=60) as answer:
            return answer.read()

    async def solved(self):
        """A session in front of the solved scene."""
        session = await Session.open(self.url)
        await session.call("solve.configure", **SETTINGS)
        out, _ = await asyncio.to_thread(self.client, "load", self.url, self.scene)
        self.assertRegex(out, r"^revision \d+\n$")
        return session, await self.converged(session, int(out.split()[1]))

    async def converged(self, session, revision):
        """The status at the end. The wait may be over before the round is: an estimate in its middle is enough for it."""
        status = await session.call("solve.wait", revision=revision, timeoutMs=120000)
        self.assertTrue(status["reached"], status)
        while status["state"] == "solving":
            await asyncio.sleep(0.01)
            status = await session.call("status")
        self.assertEqual(status["state"], "converged")
        return status

    def test_anOriginThatIsNoneIsRefusedByName(self):
        """It would match no page's, without a word."""
        for origin in ("viewer.example.org", "https://viewer.example.org/", "https://", "https://a.example https://b.example"):
            done = subprocess.run([program("RADIOSITYD"), "--listen", "127.0.0.1:0", "--allow-origin", origin], timeout=60,
                                  capture_output=True, text=True, check=False, env={**os.environ, MARK: self.mark})
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(f"--allow-origin {origin}: not an origin", done.stderr)
        for origin in ("https://viewer.example.org", "http://localhost:5173", "http://[::1]:5173", "null", "*"):
            self.server("--allow-origin", origin)

    def test_serverIntroducesItselfAndAnswersHello(self):
        async def body():
            session = await Session.open(self.url)
            for name in ("server", "epoch", "revision", "capabilities", "limits", "lightmaps", "glRenderer"):
                self.assertIn(name, session.info)
            self.assertEqual(session.hello["epoch"], session.info["epoch"])
            await session.close()

        self.run_async(body())

    def test_tilesHoldTheKnownIrradianceAndAnEditOfTheLampDoublesIt(self):
        async def body():
            session, status = await self.solved()
            await session.call("subscribe", maxMip=0)
            await session.tiles_until(status["tileVersion"])
            before, place = self.floor_mean(session)
            wanted = plates.FLOOR_MEAN_LUX / 2
            self.assertAlmostEqual(before / wanted, 1, delta=3 * TARGET, msg=f"{before} against {wanted} lux")

            edited = await session.call("scene.patch", **doubled(status["revision"]))
            self.assertGreater(edited["revision"], status["revision"])
            self.assertGreaterEqual(edited["affected"]["surfaces"], 1)
            told = (await session.note("scene.patched"))["params"]
            self.assertEqual(told["revision"], edited["revision"])
            self.assertEqual(told["patch"], doubled()["patch"])

            status = await self.converged(session, edited["revision"])
            await session.tiles_until(status["tileVersion"])
            after, _ = self.floor_mean(session, place)
            self.assertAlmostEqual(after / before, 2, delta=4 * TARGET)
            self.assertAlmostEqual(after / plates.FLOOR_MEAN_LUX, 1, delta=3 * TARGET)

            scene = await session.call("scene.get")
            self.assertEqual(scene["revision"], edited["revision"])
            document = scene.get("gltf") or json.loads(self.get("/scene.gltf"))
            self.assertEqual(document["materials"][plates.LAMP_MATERIAL]["emissiveFactor"], [1.0, 1.0, 1.0])
            await session.close()

        self.run_async(body())

    def floor_mean(self, session, place=None):
        """Mean irradiance of the floor by the newest mip-0 tiles, and where the floor lies."""
        page_index, uvs = place or plates.floor_place(plates.Glb(self.get("/scene.glb")))
        tiles = [t for t in session.tiles if t.page == page_index and t.mip == 0]
        self.assertTrue(tiles, "no tiles came")
        width = max(t.x + t.width for t in tiles)
        height = max(t.y + t.height for t in tiles)
        page = plates.Page(width, height, [None] * (width * height))
        for tile in sorted(tiles, key=lambda t: t.version):
            for y in range(tile.height):
                start = (tile.y + y) * width + tile.x
                page.pixels[start:start + tile.width] = tile.pixels[y * tile.width:(y + 1) * tile.width]
        self.assertNotIn(None, page.pixels, "tiles leave holes in the page")
        return page.mean_in(uvs), (page_index, uvs)

    def test_everyQuantityIsStreamedAndFetched(self):
        async def body():
            session, status = await self.solved()
            finest = {}
            for kind, quantity in enumerate(("irradiance", "radiosity", "error", "patchId", "mipLevel", "unshot", "normal")):
                self.assertIn(f"quantity.{quantity}", session.info["capabilities"])
                session.tiles.clear()
                await session.call("subscribe", quantity=quantity)
                self.assertEqual((await session.note("lightmaps"))["params"]["quantity"], quantity)
                while (await session.note("bookmark"))["params"]["quantity"] != quantity:
                    pass
                tiles = [tile for tile in session.tiles if tile.kind == kind]
                self.assertEqual({tile.format for tile in tiles}, {3 if quantity in ("patchId", "mipLevel") else 0})
                finest[quantity] = [p for t in sorted(tiles, key=lambda t: (t.page, t.y, t.x)) if t.mip == 0
                                    for p in t.pixels]
                self.assertEqual((await asyncio.to_thread(self.get, f"/lightmaps/0.exr?quantity={quantity}"))[:4],
                                 b"\x76\x2f\x31\x01")
            patches = [i for i, (patch,) in enumerate(finest["patchId"]) if patch != 0xFFFFFFFF]
            self.assertEqual(len(patches), status["patches"])
            self.assertEqual(len({finest["patchId"][i] for i in patches}), len(patches))
            for i in patches:
                self.assertGreaterEqual(finest["radiosity"][i][0], 0)
                n = [2 * v - 1 for v in finest["normal"][i]]
                self.assertAlmostEqual(sum(v * v for v in n), 1, delta=0.01)
            sums = {q: sum(v * v for i in patches for v in finest[q][i]) for q in ("error", "irradiance")}
            # All texels are of one size; a tile that hardly changed may be a little old.
            self.assertAlmostEqual((sums["error"] / sums["irradiance"]) ** 0.5 / status["error"]["texels"], 1, delta=0.1)
            await session.close()

        self.run_async(body())

    def test_racingEditsHaveOneWinner(self):
        async def body():
            session, status = await self.solved()
            await session.call("scene.patch", **doubled(status["revision"]))
            with self.assertRaises(RpcError) as refused:
                await session.call("scene.patch", **doubled(status["revision"]))
            self.assertEqual(refused.exception.code, -32009)
            self.assertEqual(refused.exception.data["revision"], status["revision"] + 1)
            await session.close()

        self.run_async(body())

    def test_anEditOfASceneThatWasReplacedIsRefused(self):
        async def body():
            session, status = await self.solved()
            first = await session.call("scene.patch", **doubled(), sameSceneAs=status["revision"])
            await asyncio.to_thread(self.client, "load", self.url, self.scene)
            with self.assertRaises(RpcError) as refused:
                await session.call("scene.patch", **doubled(), sameSceneAs=first["revision"])
            self.assertEqual(refused.exception.code, -32009)
            self.assertEqual(refused.exception.data["revision"], first["revision"] + 1)
            await session.close()

        self.run_async(body())

    def test_sameRequestIdIsAppliedOnce(self):
        async def body():
            session, _ = await self.solved()
            first = await session.call("scene.patch", **doubled(), requestId="lamp-1")
            again = await session.call("scene.patch", **doubled(), requestId="lamp-1")
            self.assertEqual(first, again)
            self.assertEqual((await session.call("status"))["revision"], first["revision"])
            await session.close()

        self.run_async(body())

    def test_badPatchNamesOperationAndPointerAndChangesNothing(self):
        async def body():
            session, status = await self.solved()
            patch = doubled()["patch"] + [{"op": "replace", "path": "/materials/99/name", "value": "x"}]
            with self.assertRaises(RpcError) as refused:
                await session.call("scene.patch", patch=patch)
            self.assertEqual(refused.exception.data.get("op"), 1)
            self.assertEqual(refused.exception.data.get("pointer"), "/materials/99/name")
            with self.assertRaises(RpcError) as failed:
                await session.call("scene.patch", patch=[{"op": "test", "path": LAMP_EMISSION, "value": [9, 9, 9]}])
            self.assertEqual(failed.exception.code, -32010)
            self.assertEqual((await session.call("status"))["revision"], status["revision"])
            await session.close()

        self.run_async(body())

    def test_malformedMessagesAreAnsweredWithTheirError(self):
        async def body():
            session = await Session.open(self.url)
            answer = await session.raw('{"jsonrpc": "2.0", "id": 1, "method"')
            self.assertEqual((answer["error"]["code"], answer["id"]), (-32700, None))
            answer = await session.raw('{"jsonrpc": "2.0", "id": 7, "method": "no.such"}')
            self.assertEqual((answer["error"]["code"], answer["id"]), (-32601, 7))
            answer = await session.raw('{"jsonrpc": "2.0", "id": 8, "method": "solve.wait", "params": {"error": "x"}}')
            self.assertEqual((answer["error"]["code"], answer["id"]), (-32602, 8))
            answer = await session.raw("[" * 100000)
            self.assertEqual(answer["error"]["code"], -32700)
            self.assertIn("state", await session.call("status"))
            await session.close()

        self.run_async(body())

    def test_statusBalancesItsEnergy(self):
        async def body():
            session, status = await self.solved()
            energy = status["energy"]
            lost = energy["absorbed"] + energy["specular"] + energy["escaped"] + energy["backface"] + energy["unshot"] + \
                energy["imbalance"]
            self.assertGreater(energy["emitted"], 0)
            self.assertAlmostEqual(lost / energy["emitted"], 1, delta=1e-5)
            error = status["error"]
            self.assertLessEqual(error["texels"], TARGET)
            # The specification's sum; numbers are rounded to nine digits or more.
            self.assertAlmostEqual(error["residual"] ** 2 + error["sampling"] ** 2 + error["variation"] ** 2,
                                   error["texels"] ** 2, delta=1e-6 * error["texels"] ** 2)
            await session.close()

        self.run_async(body())

    def test_httpTellsHealthReadinessMetricsAndRefusals(self):
        self.assertEqual(self.get("/healthz"), b"ok\n")
        self.assertIn(b"radiosityd_", self.get("/metrics"))
        with self.assertRaises(urllib.error.HTTPError) as missing:
            self.get("/no/such/path")
        self.assertEqual(missing.exception.code, 404)
        missing.exception.close()

    def test_sigtermDrainsAndExitsCleanly(self):
        async def body():
            session, _ = await self.solved()
            self.running.process.send_signal(signal.SIGTERM)
            self.assertIn("graceMs", (await session.note("draining"))["params"])

        self.run_async(body())
        self.assertEqual(self.running.wait(60), 0, self.running.log())
        self.assertEqual(marked_processes(self.mark), [])

    def test_killedServerLeavesNoWorker(self):
        async def body():
            session, _ = await self.solved()
            await session.close()

        self.run_async(body())
        self.running.kill()
        self.assertNothingLeft()

    def test_portInUseIsSaidPlainly(self):
        with self.assertRaises(AssertionError) as refused:
            self.server(port=self.running.port)
        self.assertIn(str(self.running.port), str(refused.exception))
        self.assertIn("in use", str(refused.exception).lower())


if __name__ == "__main__":
    unittest.main()
