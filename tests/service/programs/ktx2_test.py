"""KTX2 textures (KHR_texture_basisu): `radiosity` sends PNGs in their place, and the server refuses them by name."""
import base64
import json
import os
import struct
import unittest
import urllib.error
import urllib.request

import pictures
import plates
from harness import ServiceCase

RED = (200, 10, 20, 255)


def make_ktx2(colour, width=4, height=4, claimed=None):
    """Solid blocks of UASTC (its mode 8: five bits of code, then the colour), from the specification."""
    block = (0b10111 | sum(channel << (5 + 8 * i) for i, channel in enumerate(colour))).to_bytes(16, "little")
    data = block * ((width + 3) // 4 * ((height + 3) // 4))
    description = struct.pack("<3I9B", 44, 0, 2 | 40 << 16, 166, 1, 2, 0, 3, 3, 0, 0, 16).ljust(28, b"\0")
    description += struct.pack("<H2B2I", 0, 127, 3, 0, 0) + struct.pack("<I", 0xFFFFFFFF)
    offset = 160
    head = b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack("<13I2Q", 0, 1, claimed or width, height, 0, 0, 1, 1, 0, 104,
                                                     len(description), 0, 0, 0, 0)
    return (head + struct.pack("<3Q", offset, len(data), len(data)) + description).ljust(offset, b"\0") + data


class Ktx2Test(ServiceCase):
    def write_scene(self, name, ktx2, png=None):
        """The plates, their floor painted by a KTX2 texture, or by a PNG for those who do not know it."""
        gltf = plates.lit_document()
        body = b"".join(plates._quads())
        gltf["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
        (self.folder / "paint.ktx2").write_bytes(ktx2)
        gltf["images"] = [{"uri": "paint.ktx2", "name": "paint"}]
        gltf["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
        gltf["extensionsUsed"] = gltf.get("extensionsUsed", []) + ["KHR_texture_basisu"]
        if png:
            (self.folder / "paint.png").write_bytes(png)
            gltf["images"].append({"uri": "paint.png"})
            gltf["textures"][0]["source"] = 1
        else:
            gltf["extensionsRequired"] = ["KHR_texture_basisu"]
        gltf["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
        scene = self.folder / name
        scene.write_text(json.dumps(gltf))
        return scene

    def test_areSentAsPngs(self):
        scene = self.write_scene("room.gltf", make_ktx2(RED))
        self.client("solve", scene, "-o", "lit.glb", "--error", 0.05, "--texels", 2000)
        glb = plates.Glb((self.folder / "lit.glb").read_bytes())
        self.assertNotIn("KHR_texture_basisu", json.dumps(glb.json))
        self.assertEqual(glb.json["textures"], [{"source": 0}])
        self.assertEqual(glb.json["images"][0]["mimeType"], "image/png")
        view = glb.json["bufferViews"][glb.json["images"][0]["bufferView"]]
        png = glb.buffer(view["buffer"])[view.get("byteOffset", 0):][:view["byteLength"]]
        self.assertAlmostEqual(pictures.brightness(png), sum(RED[:3]) / 3, delta=0.01)

    def test_thatAreDamagedAreRefusedWithTheirName(self):
        scene = self.write_scene("room.gltf", make_ktx2(RED, claimed=2**30))
        text = self.complaint("solve", scene, "-o", "lit.glb")
        self.assertIn("/images/0 (paint)", text)
        self.assertIn("claims 1073741824 x 4 pixels", text)
        self.assertFalse((self.folder / "lit.glb").exists())

    def test_withoutNodeAreRefusedWithAdvice(self):
        scene = self.write_scene("room.gltf", make_ktx2(RED))
        bare = self.folder / "bare"
        bare.mkdir()
        text = self.complaint("solve", scene, "-o", "lit.glb", env={**os.environ, "PATH": str(bare)})
        self.assertIn("node was not found", text)
        scene = self.write_scene("both.gltf", make_ktx2(RED), png=pictures.onePixel(RED[:3]))
        self.client("solve", scene, "-o", "lit.glb", "--error", 0.05, "--texels", 2000,
                    env={**os.environ, "PATH": str(bare)})

    def test_areRefusedByTheServerWithTheirName(self):
        scene = json.loads(self.write_scene("room.gltf", make_ktx2(RED)).read_text())
        scene["images"][0]["uri"] = "data:image/ktx2;base64," + base64.b64encode(make_ktx2(RED)).decode()
        server = self.server()
        request = urllib.request.Request(f"http://127.0.0.1:{server.port}/scene?name=room.gltf",
                                         json.dumps(scene).encode(), {"Content-Type": "model/gltf+json"}, method="PUT")
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=60)
        text = refused.exception.read().decode()
        self.assertIn("image 0 ('paint') is KTX2", text)
        self.assertIn("/textures/0/extensions/KHR_texture_basisu", text)


if __name__ == "__main__":
    unittest.main()
