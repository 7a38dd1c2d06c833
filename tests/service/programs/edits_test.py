"""Live edits through the real programs: every kind of change, bad input, races, undo, scripts."""
import asyncio
import base64
import hashlib
import json
import struct
import unittest
import urllib.request

import plates
from harness import ServiceCase
from patience import PATIENCE
from wire import RpcError, Session

SETTINGS = {"targetError": 0.05, "texels": 2000, "seed": 1}
STRENGTH = "/materials/@lamp/extensions/KHR_materials_emissive_strength/emissiveStrength"
BAD_CALL, TEST_FAILED, STALE, INVALID, TOO_LARGE, NOT_FOUND = -32602, -32010, -32009, -32022, -32013, -32004


def replace(path, value):
    return {"op": "replace", "path": path, "value": value}


def add(path, value):
    return {"op": "add", "path": path, "value": value}


class EditsCase(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.document())
        self.running = self.server(self.scene)
        self.url = self.running.url

    def run_async(self, coroutine):
        return asyncio.run(asyncio.wait_for(coroutine, 600 * PATIENCE))

    def put(self, path, body):
        request = urllib.request.Request(self.url + path, data=body, method="PUT",
                                         headers={"Content-Type": "application/octet-stream"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    async def session(self):
        session = await Session.open(self.url)
        await session.call("solve.configure", **SETTINGS)
        await session.call("solve.wait", timeoutMs=60000)
        return session

    async def gltf(self, session):
        return (await session.call("scene.get"))["gltf"]

    async def patch(self, session, *operations, **more):
        return await session.call("scene.patch", patch=list(operations), **more)


class PatchTest(EditsCase):
    def test_everyKindOfChangeIsMadeAndTakenBack(self):
        triangle = struct.pack("<9f", 0, 0.5, 0, 0.2, 0.5, 0, 0, 0.5, 0.2)
        kinds = {
            "emission": [replace("/materials/@lamp/emissiveFactor", [1, 0.5, 0.2])],
            "reflectance": [replace("/materials/@floor/pbrMetallicRoughness/baseColorFactor", [0.2, 0.7, 0.2, 1])],
            "two sides": [replace("/materials/@floor/doubleSided", True)],
            "alpha": [replace("/materials/@floor/alphaMode", "BLEND"),
                      replace("/materials/@floor/pbrMetallicRoughness/baseColorFactor", [0.5, 0.5, 0.5, 0.5])],
            "move": [replace("/nodes/@lamp/translation", [0.1, 0.2, 0])],
            "rotate": [replace("/nodes/@lamp/rotation", [0, 0.6, 0, 0.8])],
            "scale": [replace("/nodes/@lamp/scale", [0.5, 1, 0.5])],
            "hide": [replace("/nodes/@lamp/extensions/KHR_node_visibility/visible", False)],
            "add a node": [add("/nodes/-", {"name": "copy", "mesh": 0, "translation": [0, 0.5, 0]}),
                           add("/scenes/0/nodes/-", 3)],
            "remove a node": [replace("/scenes/0/nodes", [0, 2])],
            "add a material": [add("/materials/-", {"name": "new"}), replace("/meshes/0/primitives/0/material", 2)],
            "another mesh": [replace("/nodes/@floor/mesh", 1)],
            "texels": [add("/nodes/@floor/extras", {"radiosityTexelScale": 2})],
            "mesh from an upload": [add("/buffers/-", {"uri": self.put("/uploads", triangle)["url"]}),
                                    add("/bufferViews/-", {"buffer": 1, "byteLength": 36}),
                                    add("/accessors/-", {"bufferView": 2, "componentType": 5126, "count": 3,
                                                         "type": "VEC3"}),
                                    add("/meshes/-", {"primitives": [{"attributes": {"POSITION": 3}, "material": 0}]}),
                                    replace("/nodes/@floor/mesh", 2)],
        }

        async def body():
            session = await self.session()
            before = await self.gltf(session)
            for kind, patch in kinds.items():
                with self.subTest(kind=kind):
                    dry = await self.patch(session, *patch, dryRun=True)
                    self.assertEqual(await self.gltf(session), before)
                    edit = await self.patch(session, *patch)
                    self.assertEqual(edit["affected"]["surfaces"] > 0, dry["affected"]["surfaces"] > 0)
                    self.assertGreater(edit["affected"]["surfaces"], 0)
                    status = await session.call("solve.wait", revision=edit["revision"], timeoutMs=60000)
                    self.assertTrue(status["reached"], status)
                    after = await self.gltf(session)
                    undo = await session.call("scene.undo")
                    self.assertEqual((undo["revision"], undo["edit"]), (edit["revision"] + 1, edit["revision"]))
                    self.assertEqual(await self.gltf(session), before)
                    await session.call("scene.redo")
                    self.assertEqual(await self.gltf(session), after)
                    await session.call("scene.undo")
            await session.close()

        self.run_async(body())

    def test_aMoveKeepsTheLayoutAndSendsNoTileBeforeItsLightChanges(self):
        async def body():
            session = await self.session()
            await session.call("solve.configure", targetError=1e-6)  # so that it can be paused
            await session.call("solve.wait", error=0.05, timeoutMs=60000)
            await session.call("solve.pause")
            await session.call("subscribe")
            layout = (await session.note("lightmaps"))["params"]["layout"]
            await session.tiles_until((await session.call("status"))["tileVersion"])
            held = len(session.tiles)
            edit = await self.patch(session, replace("/nodes/@lamp/translation", [0.1, 0.2, 0]))
            while (await session.note("bookmark"))["params"]["revision"] < edit["revision"]:
                pass
            self.assertEqual(len(session.tiles), held, "nothing has changed yet")
            await session.call("solve.resume")
            status = await session.call("solve.wait", error=0.05, revision=edit["revision"], timeoutMs=60000)
            self.assertTrue(status["reached"], status)
            await session.call("solve.pause")
            await session.tiles_until((await session.call("status"))["tileVersion"])
            self.assertGreater(len(session.tiles), held)
            self.assertFalse([tile for tile in session.tiles[held:] if tile.flags & 2], "a reset")
            self.assertFalse([note for note in session.notes if note["method"] == "lightmaps"])
            late = await Session.open(self.url)
            await late.call("subscribe")
            self.assertEqual((await late.note("lightmaps"))["params"]["layout"], layout)
            await late.close()
            await self.patch(session, replace("/nodes/@lamp/scale", [0.5, 1, 0.5]))
            self.assertGreater((await session.note("lightmaps"))["params"]["layout"], layout, "another size, other texels")
            await session.close()

        self.run_async(body())

    def test_theSameUploadLiesThereOnce(self):
        first, second = (self.put("/uploads", b"some bytes")["url"] for _ in range(2))
        self.assertEqual(first, second)
        self.assertEqual(first, "/uploads/" + hashlib.sha256(b"some bytes").hexdigest())

    def test_aTextureIsReplacedByAnUploadedOne(self):
        png = base64.b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==")

        async def body():
            session = await self.session()
            url = self.put("/uploads", png)["url"]
            edit = await self.patch(session, add("/images", [{"uri": url, "mimeType": "image/png"}]),
                                    add("/textures", [{"source": 0}]),
                                    add("/materials/@floor/pbrMetallicRoughness/baseColorTexture", {"index": 0}))
            self.assertEqual(edit["affected"]["surfaces"], 1)
            gltf = await self.gltf(session)
            self.assertEqual(gltf["images"], [{"mimeType": "image/png"}])
            self.assertTrue((await session.call("solve.wait", timeoutMs=60000))["reached"])
            await session.close()

        self.run_async(body())

    def test_badInputChangesNothingAndSaysWhere(self):
        name = replace("/nodes/@floor/name", "floor")
        deep = 1
        for _ in range(40):
            deep = [deep]
        cases = [
            (BAD_CALL, 0, "/params/patch/0/op", [{"path": "/a"}]),
            (INVALID, 1, "/nodes/@nobody/scale", [name, replace("/nodes/@nobody/scale", [1, 1, 1])]),
            (INVALID, 0, "/nodes/7/name", [replace("/nodes/7/name", "x")]),
            (INVALID, 0, "/nodes/0/translation/1", [replace("/nodes/0/translation/1", 5)]),
            (INVALID, 0, "/nodes/0", [{"op": "remove", "path": "/nodes/0"}]),
            (TEST_FAILED, 1, "/nodes/0/name", [name, {"op": "test", "path": "/nodes/0/name", "value": "x"}]),
            (INVALID, 1, "/nodes/1/mesh", [name, replace("/nodes/@lamp/mesh", 9), name]),
            (INVALID, 0, "/nodes/0/translation/0", [replace("/nodes/0/translation", [1e300, 0, 0])]),
            (INVALID, 0, "/nodes/0/translation/0", [replace("/nodes/0/translation", [None, 0, 0])]),
            (INVALID, 1, "/materials/0/emissiveFactor/0", [name, replace("/materials/0/emissiveFactor", [-1, 0, 0])]),
            (INVALID, 1, "/buffers/1", [name, add("/buffers/-", {"byteLength": 12})]),
            (NOT_FOUND, 0, "/buffers/1/uri", [add("/buffers/-", {"uri": "/uploads/" + "0" * 64})]),
            (TOO_LARGE, 1, "/nodes/0/extras" + "/0" * 30,
             [add("/nodes/0/extras", deep), add("/nodes/0/extras" + "/0" * 30, deep)]),
        ]

        async def body():
            session, other = await self.session(), await Session.open(self.url)
            before, revision = await self.gltf(session), (await session.call("status"))["revision"]
            for code, op, pointer, patch in cases:
                with self.subTest(patch=str(patch)[:100]):
                    with self.assertRaises(RpcError) as caught:
                        await self.patch(session, *patch)
                    self.assertEqual((caught.exception.code, caught.exception.data.get("op"),
                                      caught.exception.data.get("pointer")), (code, op, pointer), str(caught.exception))
            with self.assertRaises(RpcError) as caught:  # who closes the circle is one of two
                await self.patch(session, add("/nodes/0/children", [1]), add("/nodes/1/children", [0]),
                                 replace("/scenes/0/nodes", [2]))
            self.assertEqual(caught.exception.code, INVALID)
            self.assertIn("cycle", str(caught.exception))
            self.assertIn(caught.exception.data["op"], (0, 1))
            with self.assertRaises(RpcError) as caught:
                await self.patch(session, *[name] * 5001)
            self.assertEqual(caught.exception.code, BAD_CALL)
            answer = await session.raw('{"jsonrpc":"2.0","id":1,"method":"scene.patch","params":{"patch":[{"op":"add",'
                                       '"path":"/nodes/0/scale","value":[NaN,1,1]}]}}')
            self.assertEqual(answer["error"]["code"], -32700)
            for each in (session, other):
                status = await each.call("status")
                self.assertEqual((status["revision"], status["state"]), (revision, "converged"))
            self.assertEqual(await self.gltf(other), before)
            self.assertEqual([n for n in other.notes if n["method"] == "scene.patched"], [])
            await session.close()
            await other.close()

        self.run_async(body())

    def test_ofTwoWritersOnOneRevisionExactlyOneWinsAlways(self):
        async def body():
            writers = [await self.session(), *[await Session.open(self.url) for _ in range(3)]]
            revision = (await writers[0].call("status"))["revision"]
            await writers[0].call("solve.pause")

            async def attempt(writer, value):
                # A patch, an undo or a redo: whatever comes first wins.
                try:
                    if value % 4 == 3 and revision > 3:
                        return await writer.call("scene.undo", baseRevision=revision)
                    return await self.patch(writer, replace(STRENGTH, value + 1), baseRevision=revision)
                except RpcError as error:
                    return error

            for turn in range(60):
                answers = await asyncio.gather(*(attempt(w, turn + i) for i, w in enumerate(writers)))
                winners = [a for a in answers if not isinstance(a, RpcError)]
                self.assertEqual(len(winners), 1, answers)
                for loser in (a for a in answers if isinstance(a, RpcError)):
                    self.assertEqual((loser.code, loser.data["revision"]), (STALE, revision + 1))
                revision = winners[0]["revision"]
            for writer in writers:
                await writer.close()

        self.run_async(body())

    def test_aRepeatedUndoIsTakenOnce(self):
        async def body():
            session = await self.session()
            await self.patch(session, replace(STRENGTH, 3))
            await self.patch(session, replace(STRENGTH, 4))
            first = await session.call("scene.undo", requestId="u1")
            self.assertEqual(await session.call("scene.undo", requestId="u1"), first)
            history = await session.call("scene.history")
            self.assertEqual((history["undoable"], history["redoable"]), (1, 1))
            self.assertEqual([r["kind"] for r in history["revisions"]], ["load", "patch", "patch", "undo"])
            self.assertEqual(history["revisions"][1]["by"], "service test")
            self.assertEqual(history["revisions"][2]["undone"], True)
            with self.assertRaises(RpcError):
                await session.call("scene.redo", requestId="u1")  # the id of another edit
            await session.call("scene.undo")
            with self.assertRaises(RpcError) as caught:
                await session.call("scene.undo")
            self.assertEqual(caught.exception.code, NOT_FOUND)
            await session.close()

        self.run_async(body())


class ShortFormsTest(EditsCase):
    def scene_now(self):
        with urllib.request.urlopen(self.url + "/scene.gltf", timeout=60) as answer:
            return json.load(answer)

    def test_shortFormsEditTheScene(self):
        for words in (("set", "@lamp.emissiveStrength", 20), ("set", "@floor.color", "0.2,0.3,0.4"),
                      ("move", "@lamp", -0.5, 0, 0.25), ("move", "@lamp", 0, 0.5, 0, "--by"),
                      ("rotate", "@lamp", -90), ("scale", "@floor", 2), ("hide", "@floor")):
            out, _ = self.client(words[0], self.url, *words[1:])
            self.assertRegex(out, r"^revision \d+, affected: \d+ surfaces, \d+ shots\n$", words)
        gltf = self.scene_now()
        lamp, floor = gltf["nodes"][1], gltf["nodes"][0]
        self.assertEqual(gltf["materials"][1]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 20)
        self.assertEqual(gltf["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], [0.2, 0.3, 0.4, 1])
        self.assertEqual(lamp["translation"], [-0.5, 0.5, 0.25])
        self.assertAlmostEqual(lamp["rotation"][1], -0.5 ** 0.5)
        self.assertEqual(floor["scale"], [2, 2, 2])
        self.assertFalse(floor["extensions"]["KHR_node_visibility"]["visible"])
        self.client("show", self.url, "@floor")
        self.client("remove", self.url, "@lamp")
        self.assertEqual(self.scene_now()["scenes"][0]["nodes"], [0, 2])
        out, _ = self.client("undo", self.url)
        self.assertIn("took back revision", out)
        self.assertEqual(self.scene_now()["scenes"][0]["nodes"], [0, 1, 2])
        self.client("redo", self.url)
        out, _ = self.client("history", self.url)
        self.assertIn("by radiosity/", out)
        self.assertIn("9 edits can be taken back, 0 made again", out)

    def test_aNameThatClientsGiveThemselvesCannotSteerATerminal(self):
        async def body():
            session = await Session.open(self.url, client="\x1b]0;owned\x07\u009b2J")
            await self.patch(session, replace("/materials/@floor/doubleSided", True))
            await session.close()

        self.run_async(body())
        out, _ = self.client("history", self.url)
        self.assertIn("]0;owned", out)
        for letter in "\x1b\x07\u009b":
            self.assertNotIn(letter, out)

    def test_aFileIsAddedAndTakenBack(self):
        out, _ = self.client("add", self.url, self.scene, "--at", 0, 0, 3, "--name", "more")
        self.assertTrue(out.startswith("@more\n"), out)
        gltf = self.scene_now()
        self.assertEqual(gltf["nodes"][6]["children"], [3, 4, 5])
        self.assertEqual(gltf["nodes"][4]["mesh"], 3)
        self.assertIn("error ", self.client("wait", self.url, "--error", 0.05)[0])
        out, _ = self.client("add", self.url, self.scene, "--name", "more", "--parent", "@more")
        self.assertTrue(out.startswith("@more 2\n"), out)
        self.client("move", self.url, "@more 2", 0, 1, 0)  # by the name that was told
        for _ in range(3):
            self.client("undo", self.url)
        self.assertEqual(len(self.scene_now()["nodes"]), 3)
        self.client("redo", self.url)
        self.client("remove", self.url, "@more")
        self.assertEqual(self.scene_now()["scenes"][0]["nodes"], [0, 1, 2])
        (self.folder / "bad.glb").write_bytes(b"glTF\2\0\0\0" + b"\0" * 40)
        self.assertIn("bad.glb", self.complaint("add", self.url, "bad.glb"))

    def test_mistakesExit2AndSayWhatIsThere(self):
        self.assertIn("floor, lamp, eye", self.complaint("move", self.url, "@chair", 0, 0, 0))
        self.assertIn("floor, lamp", self.complaint("set", self.url, "@x.emissiveStrength", 1))
        self.assertIn("/materials/1/emissiveFactor", self.complaint("set", self.url, "@lamp.emissiveFactor", "red"))
        self.assertIn("no edit to take back", self.complaint("undo", self.url))
        (self.folder / "nothing.json").write_text('[{"op":"test","path":"/asset/nothing","value":1}]')
        text = self.complaint("edit", self.url, "nothing.json")
        self.assertIn("error: operation 0: /asset/nothing: ", text)
        self.assertEqual(text.count("operation 0"), 1, text)

    def test_aScriptSweepsAndRecords(self):
        (self.folder / "sweep.txt").write_text(
            "# two pictures\nfor s in 5 20 index i\n  set @lamp.emissiveStrength $s\n  wait --error 0.1\n"
            "  snapshot -o lamp-$i.png --width 64 --height 48\n  print done ${s}\nend\nundo\nsave -q -o lit.glb\n")
        out, errors = self.client("script", self.url, "sweep.txt")
        self.assertIn("done 5\n", out)
        self.assertIn("sweep.txt:3: set @lamp.emissiveStrength 20", errors)
        for name in ("lamp-0.png", "lamp-1.png", "lit.glb", "lit.lightmap.0.exr"):
            self.assertIn(name, self.files())
        self.assertEqual(
            self.scene_now()["materials"][1]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 5)

    def test_scriptFaultsNameFileAndLine(self):
        def fault(text, expect=2):
            return self.complaint("script", self.url, "-", stdin=text, expect=expect)

        self.assertIn("standard input:2: set: ", fault("print x\nset @lamp.emissiveStrength\n"))
        self.assertIn("standard input:1: no such command", fault("explode @lamp\n"))
        self.assertIn("standard input:1: no such command", fault("solve x.glb -o y.glb\n"))
        self.assertIn("standard input:3: ", fault("for x in 1\nprint $x\nprint $y\nend\n"))
        self.assertIn("standard input:2: @nobody", fault("print x\nmove @nobody 0 0 0\nprint y\n"))
        self.assertIn("standard input:1: ", fault("wait --error 0.000001 --timeout 0.01\n", expect=3))
        # A fault that can be seen beforehand stops the script before its first command.
        self.complaint("script", self.url, "-", stdin="set @lamp.emissiveStrength 77\nmove @lamp x y z\n")
        self.assertNotEqual(
            self.scene_now()["materials"][1]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 77)


if __name__ == "__main__":
    unittest.main()
