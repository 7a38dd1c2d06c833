"""Scenes that cost a server much for the bytes they have. All have the floor, and the lamp, of plates.py, so that whoever
edits the lamp goes on with it whichever scene is there."""
import copy
import json
import math
import random
import struct
import zlib

import plates

LAMP = "/materials/@lamp/extensions/KHR_materials_emissive_strength/emissiveStrength"
FLOAT, SHORT = 5126, 5123


class Scene:
    """A document that grows, with its binary chunk."""

    def __init__(self):
        self.gltf, self.body = plates.lit_document(), b"".join(plates._quads())

    def view(self, data):
        self.body += b"\0" * (-len(self.body) % 4)
        self.gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(self.body), "byteLength": len(data)})
        self.body += data
        return len(self.gltf["bufferViews"]) - 1

    def accessor(self, **members):
        self.gltf["accessors"].append(members)
        return len(self.gltf["accessors"]) - 1

    def mesh(self, positions, corners, **more):
        low, high = ([pick(p[k] for p in positions) for k in range(3)] for pick in (min, max))
        position = self.accessor(bufferView=self.view(struct.pack(f"<{3 * len(positions)}f", *(x for p in positions for x in p))),
                                 count=len(positions), componentType=FLOAT, type="VEC3", min=low, max=high)
        index = self.accessor(bufferView=self.view(struct.pack(f"<{len(corners)}I", *corners)), count=len(corners),
                              componentType=5125, type="SCALAR")
        self.gltf["meshes"].append({"primitives": [{"attributes": {"POSITION": position}, "indices": index, **more}]})
        return len(self.gltf["meshes"]) - 1

    def node(self, **members):
        self.gltf["scenes"][0]["nodes"].append(len(self.gltf["nodes"]))
        self.gltf["nodes"].append(members)

    def glb(self):
        gltf = copy.deepcopy(self.gltf)
        gltf["buffers"] = [{"byteLength": len(self.body)}]
        text = json.dumps(gltf, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        body = self.body + b"\0" * (-len(self.body) % 4)
        return (struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(body)) + struct.pack("<I4s", len(text), b"JSON") +
                text + struct.pack("<I4s", len(body), b"BIN\0") + body)


CUBE = [[(i >> bit & 1) - 0.5 for bit in (2, 1, 0)] for i in range(8)]
SIDES = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]


def _leaning(dice, spread, size):
    turn = [dice.gauss(0, 1) for _ in range(4)]
    length = math.sqrt(sum(x * x for x in turn))
    return {"translation": [round(spread * dice.random(), 4) for _ in range(3)],
            "rotation": [round(x / length, 7) for x in turn], "scale": [round(x, 4) for x in size]}


def instances_claimed():
    """A thousand million places of a square, in a file of two kilobytes."""
    scene = Scene()
    places = scene.accessor(count=1_000_000_000, componentType=FLOAT, type="VEC3")
    scene.gltf["extensionsUsed"].append("EXT_mesh_gpu_instancing")
    scene.node(mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}})
    return scene.glb()


def accessor_bomb():
    """Four thousand million vertices that are all zero."""
    scene = Scene()
    position = scene.accessor(count=4_000_000_000, componentType=FLOAT, type="VEC3", min=[0, 0, 0], max=[0, 0, 0])
    scene.gltf["meshes"].append({"primitives": [{"attributes": {"POSITION": position}}]})
    scene.node(mesh=len(scene.gltf["meshes"]) - 1)
    return scene.glb()


def nodes_in_one_place(count=10_000):
    scene = Scene()
    for _ in range(count):
        scene.node(mesh=0)
    return scene.glb()


def leaning_slabs(count=10_000):
    scene, dice = Scene(), random.Random(1)
    mesh = scene.mesh(CUBE, SIDES)
    for _ in range(count):
        scene.node(mesh=mesh, **_leaning(dice, 1.0, (1.0, 1.0, 0.02)))
    return scene.glb()


def leaning_tubes(count=10_000):
    scene, dice = Scene(), random.Random(1)
    mesh = scene.mesh(CUBE, SIDES[:24])
    for _ in range(count):
        size = [mean * math.exp(2.0 * dice.gauss(0, 1)) for mean in (1.0, 1.0, 0.005)]
        scene.node(mesh=mesh, **_leaning(dice, 4.0, [max(x, 0.0001) for x in size]))
    return scene.glb()


CHANNELS = {0: 1, 6: 4}


def _png_of(data, side, colour, depth=8):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", side, side, depth, colour, 0, 0, 0)) +
            chunk(b"IDAT", data) + chunk(b"IEND", b""))


def _png(side, colour=0, level=0x80):
    """All of one value."""
    return _png_of(zlib.compress((b"\0" + bytes([level]) * (CHANNELS[colour] * side)) * side, 9), side, colour)


def _noisy_png(dice, noise, side):
    """So many bytes of noise, and black below them."""
    row = 4 * side
    rows = [b"\0" + dice.randbytes(row) if y < noise // row else b"\0" * (row + 1) for y in range(side)]
    return _png_of(zlib.compress(b"".join(rows), 9), side, 6)


def _pictured(scene, images):
    """A square for each image."""
    places = scene.accessor(bufferView=scene.view(struct.pack("<8f", 0, 0, 1, 0, 1, 1, 0, 1)), count=4, componentType=FLOAT,
                            type="VEC2")
    scene.gltf.update(images=images, textures=[{"source": i} for i in range(len(images))])
    for i in range(len(images)):
        scene.gltf["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}})
        scene.gltf["meshes"].append({"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": places}, "indices": 2,
                                                     "material": len(scene.gltf["materials"]) - 1}]})
        scene.node(mesh=len(scene.gltf["meshes"]) - 1, translation=[2 + 2 * (i % 20), 0, 2 * (i // 20)])
    return scene.glb()


def forty_pictures(side=4096):
    scene = Scene()
    return _pictured(scene, [{"bufferView": scene.view(_png(side)), "mimeType": "image/png"} for _ in range(40)])


def large_picture(side=8192):
    """As many pixels as a picture may have, of colours with alpha."""
    scene = Scene()
    return _pictured(scene, [{"bufferView": scene.view(_png(side, colour=6)), "mimeType": "image/png"}])


def many_pictures(count=5, side=2048):
    """Each as dear as the bytes that are left for it, up to a mebibyte in all: nothing in them repeats."""
    scene, dice = Scene(), random.Random(1)
    return _pictured(scene, [{"bufferView": scene.view(_noisy_png(dice, 195_000, side)), "mimeType": "image/png"}
                             for _ in range(count)])


def _segment(marker, data):
    return bytes([0xFF, marker]) + struct.pack(">H", len(data) + 2) + data


def _packed(bits):
    data = int(bits + "1" * (-len(bits) % 8), 2).to_bytes((len(bits) + 7) // 8, "big")
    return data.replace(b"\xff", b"\xff\0")


def _jpeg_of_scans(scans, side=8192):
    """Progressive, of one channel; all scans but the first say that no block has anything."""
    blocks = (side // 8) ** 2
    def table(kind, symbol):
        return _segment(0xC4, bytes([kind, 1] + [0] * 15 + [symbol]))
    def scan(first, last, data):
        return _segment(0xDA, bytes([1, 1, 0, first, last, 0])) + data
    head = (b"\xff\xd8" + _segment(0xDB, bytes([0]) + b"\1" * 64) +
            _segment(0xC2, struct.pack(">BHHB3B", 8, side, side, 1, 1, 0x11, 0)) + table(0, 0) + table(0x10, 0xE0))
    return (head + scan(0, 0, _packed("0" * blocks)) +
            scan(1, 63, _packed("011111111111111" * (blocks // 32767 + 1))) * scans + b"\xff\xd9")


def picture_of_scans(scans=6000):
    scene = Scene()
    return _pictured(scene, [{"bufferView": scene.view(_jpeg_of_scans(scans)), "mimeType": "image/jpeg"}])


def deep_picture(side=8192):
    """Of 16 bits a channel."""
    scene = Scene()
    rows = zlib.compressobj(9)
    data = b"".join(rows.compress(b"\0" + b"\x80\x10" * 4 * side) for _ in range(side)) + rows.flush()
    return _pictured(scene, [{"bufferView": scene.view(_png_of(data, side, 6, 16)), "mimeType": "image/png"}])


def inflating_picture(side=16, inflated=1_000_000_000):
    """A small picture whose data inflates to a thousand million bytes, of which it needs a thousand."""
    scene, rows = Scene(), zlib.compressobj(9)
    data = b"".join(rows.compress(bytes(1_000_000)) for _ in range(inflated // 1_000_000)) + rows.flush()
    return _pictured(scene, [{"bufferView": scene.view(_png_of(data, side, 6)), "mimeType": "image/png"}])


def _solid_webp(side):
    """Lossless, of one colour: each of its five codes has one symbol, so that a pixel takes no bit at all."""
    bits, at = side - 1 | side - 1 << 14, 28 + 4 + 3  # no alpha, version 0; no transform, no cache, one group of codes
    for _ in range(5):
        bits |= 0b0001 << at  # simple, one symbol, of one bit: 0
        at += 4
    body = b"\x2f" + bits.to_bytes((at + 7) // 8, "little")
    chunk = b"VP8L" + struct.pack("<I", len(body)) + body + b"\0" * (len(body) % 2)
    return b"RIFF" + struct.pack("<I", 4 + len(chunk)) + b"WEBP" + chunk


def solid_webps(count=4, side=8192):
    """As large as pictures may be, in 26 bytes each."""
    scene = Scene()
    scene.gltf["extensionsUsed"].append("EXT_texture_webp")
    scene.gltf["extensionsRequired"] = ["EXT_texture_webp"]
    images = [{"bufferView": scene.view(_solid_webp(side)), "mimeType": "image/webp"} for _ in range(count)]
    _pictured(scene, images)
    for texture in scene.gltf["textures"]:
        texture["extensions"] = {"EXT_texture_webp": {"source": texture.pop("source")}}
    return scene.glb()


def tiny_pictures(count=2000, side=64):
    scene = Scene()
    return _pictured(scene, [{"bufferView": scene.view(_png(side, level=i % 256)), "mimeType": "image/png"}
                             for i in range(count)])


def cut_off_pictures(count=500, side=2048):
    """So many files that all begin in one place, and end before the picture does."""
    scene = Scene()
    picture = _png(side)
    whole = scene.gltf["bufferViews"][scene.view(picture)]
    images = []
    for i in range(count):
        scene.gltf["bufferViews"].append({**whole, "byteLength": len(picture) - 12 - i})
        images.append({"bufferView": len(scene.gltf["bufferViews"]) - 1, "mimeType": "image/png"})
    return _pictured(scene, images)


def many_nodes(count=60_000):
    """What an honest large scene is: nodes of two triangles beside each other."""
    scene = Scene()
    side = math.isqrt(count) + 1
    for i in range(count):
        scene.node(mesh=0, translation=[2 * (i % side), 0, 2 + 2 * (i // side)])
    return scene.glb()


def many_triangles(side=400):
    """A hilly ground of 2 side^2 triangles, in one mesh."""
    scene = Scene()
    points = [(x * 0.1, 0.2 * math.sin(0.7 * x) * math.cos(0.5 * z) - 2.0, z * 0.1) for z in range(side + 1)
              for x in range(side + 1)]
    corners = []
    for z in range(side):
        for x in range(side):
            a = z * (side + 1) + x
            corners += [a, a + side + 1, a + 1, a + 1, a + side + 1, a + side + 2]
    scene.node(mesh=scene.mesh(points, corners), translation=[-0.05 * side, 0, -0.05 * side])
    return scene.glb()


def entries_of(name, most=1 << 20):
    """A mebibyte of what takes three bytes each, and more once it is read."""
    def make():
        scene = Scene()
        scene.gltf.setdefault(name, []).extend([{}] * ((most - len(scene.glb()) - 64) // 3))
        return scene.glb()
    return make


def point_lights(count=18_000):
    """Lamps, as many as a mebibyte holds."""
    scene = Scene()
    scene.gltf["extensionsUsed"].append("KHR_lights_punctual")
    scene.gltf["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 9}]}}
    for _ in range(count):
        scene.node(extensions={"KHR_lights_punctual": {"light": 0}})
    return scene.glb()


def shining_squares(count=14_000):
    """Lamps that are surfaces."""
    scene, side = Scene(), math.isqrt(count) + 1
    for i in range(count):
        scene.node(mesh=1, translation=[2 * (i % side), 0, 2 + 2 * (i // side)])
    return scene.glb()


def poses(vertices=20_000, count=10_000):
    """Each node has a mesh of its own in memory, since each has weights of its own."""
    scene, dice = Scene(), random.Random(1)
    points = [(dice.random(), dice.random(), dice.random()) for _ in range(vertices)]
    mesh = scene.mesh(points, [i % vertices for i in range(3 * vertices)][:3000])
    primitive = scene.gltf["meshes"][mesh]["primitives"][0]
    primitive["targets"] = [{"POSITION": primitive["attributes"]["POSITION"]}]
    for i in range(count):
        scene.node(mesh=mesh, weights=[i / count])
    return scene.glb()


def room(path):
    """A room of ours whose lamp has the name that is edited."""
    with open(path, "rb") as file:
        glb = plates.Glb(file.read())
    for material in glb.json["materials"]:
        if "emissiveFactor" in material:
            material["name"] = "lamp"
    scene = Scene()
    scene.gltf, scene.body = glb.json, glb.bin
    return scene.glb()
