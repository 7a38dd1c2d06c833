"""A scene with a known answer: a floor and a lamp, unit squares one metre apart, and readers for what a solve writes.

The lamp reflects nothing, so the floor's mean irradiance is pi * L * F with F = 0.1998248957 (two parallel unit
squares at distance 1; any text on configuration factors has the formula). Both vary only in brightness, so an edit
that doubles the emission doubles every texel.
"""
import base64
import json
import math
import struct
import subprocess

LUMINANCE_NITS = 10.0
FORM_FACTOR = 0.1998248957
FLOOR_MEAN_LUX = math.pi * LUMINANCE_NITS * FORM_FACTOR
LAMP_MATERIAL = 1


def _quads():
    """Positions of both squares and their indices: floor facing up at y = 0, lamp facing down at y = 1."""
    floor = [(-.5, 0, -.5), (-.5, 0, .5), (.5, 0, .5), (.5, 0, -.5)]
    lamp = [(-.5, 1, -.5), (.5, 1, -.5), (.5, 1, .5), (-.5, 1, .5)]
    positions = b"".join(struct.pack("<3f", *p) for p in floor + lamp)
    indices = struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    return positions, indices


def document():
    positions, indices = _quads()

    def material(name, rho, emission):
        return {"name": name, "emissiveFactor": [emission] * 3,
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": LUMINANCE_NITS}},
                "pbrMetallicRoughness": {"baseColorFactor": [rho, rho, rho, 1], "metallicFactor": 0}}

    def accessor(view, offset, count, **more):
        return {"bufferView": view, "byteOffset": offset, "count": count, **more}

    def vec3(offset, y):
        return accessor(0, offset, 4, componentType=5126, type="VEC3", min=[-.5, y, -.5], max=[.5, y, .5])

    def mesh(name, position, mat):
        return {"name": name, "primitives": [{"attributes": {"POSITION": position}, "indices": 2, "material": mat}]}

    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "nodes": [{"name": "floor", "mesh": 0}, {"name": "lamp", "mesh": 1},
                  {"name": "eye", "camera": 0, "translation": [0, 0.5, 2]}],
        "cameras": [{"name": "front", "type": "perspective", "perspective": {"yfov": 0.9, "znear": 0.01}}],
        "materials": [material("floor", 0.5, 0.0), material("lamp", 0.0, 0.5)],
        "meshes": [mesh("floor", 0, 0), mesh("lamp", 1, 1)],
        "accessors": [vec3(0, 0.0), vec3(48, 1.0), accessor(1, 0, 6, componentType=5123, type="SCALAR")],
        "bufferViews": [{"buffer": 0, "byteLength": len(positions)},
                        {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)}],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }


def lit_document():
    """document() with the lamp fully on; the plain one has it at half, so that an edit can double it."""
    scene = document()
    scene["materials"][LAMP_MATERIAL]["emissiveFactor"] = [1.0, 1.0, 1.0]
    return scene


def write_glb(path, scene, body=None):
    body = b"".join(_quads()) if body is None else body
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    body += b"\0" * (-len(body) % 4)
    total = 12 + 8 + len(text) + 8 + len(body)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, total))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(body), b"BIN\0") + body)


def write_gltf(path, scene, buffer_name):
    """A .gltf with its buffer in another file beside it."""
    scene = dict(scene, buffers=[dict(scene["buffers"][0], uri=buffer_name)])
    path.with_name(buffer_name).write_bytes(b"".join(_quads()))
    path.write_text(json.dumps(scene))


# ---- reading results ----

class Glb:
    """JSON and binary chunk of a GLB, each bound checked."""

    def __init__(self, data):
        magic, version, total = struct.unpack_from("<4sII", data)
        assert magic == b"glTF" and version == 2, (magic, version)
        assert total == len(data), f"the header says {total} bytes, the file has {len(data)}"
        length, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json = json.loads(data[20:20 + length])
        rest = data[20 + length:]
        self.bin = rest[8:8 + struct.unpack_from("<I", rest)[0]] if rest else b""

    def buffer(self, index):
        uri = self.json["buffers"][index].get("uri")
        if uri is None:
            return self.bin
        assert uri.startswith("data:"), uri
        return base64.b64decode(uri.split(",", 1)[1])

    def vec2s(self, accessor_index):
        accessor = self.json["accessors"][accessor_index]
        assert accessor["type"] == "VEC2" and accessor["componentType"] == 5126, accessor
        view = self.json["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", 8)
        data = self.buffer(view.get("buffer", 0))
        return [struct.unpack_from("<2f", data, start + i * stride) for i in range(accessor["count"])]

    def primitives_of(self, node_name):
        for node in self.json["nodes"]:
            if node.get("name") == node_name:
                return self.json["meshes"][node["mesh"]]["primitives"]
        raise AssertionError(f"no node {node_name}")


class Page:
    """A lightmap page: rows of (r, g, b) in lux, row 0 = v 0."""

    def __init__(self, width, height, pixels):
        self.width, self.height, self.pixels = width, height, pixels

    @staticmethod
    def from_exr(path, exr_dump):
        done = subprocess.run([exr_dump, str(path)], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()
        size, raw = done.stdout.split(b"\n", 1)
        width, height = map(int, size.split())
        return Page(width, height, list(struct.iter_unpack("<3f", raw)))

    def mean_in(self, uvs):
        """Mean of the first channel over the texels whose centres lie in the bounding box of `uvs`."""
        low = [min(uv[k] for uv in uvs) for k in (0, 1)]
        high = [max(uv[k] for uv in uvs) for k in (0, 1)]
        values = [self.pixels[y * self.width + x][0]
                  for y in range(self.height) for x in range(self.width)
                  if low[0] < (x + .5) / self.width < high[0] and low[1] < (y + .5) / self.height < high[1]]
        assert values, f"no texel of {self.width} x {self.height} lies in {low} .. {high}"
        return sum(values) / len(values)


def floor_place(glb):
    """(page, uvs) of the floor's lightmap."""
    primitives = glb.primitives_of("floor")
    uvs = [uv for p in primitives for uv in glb.vec2s(p["attributes"]["TEXCOORD_1"])]
    return primitives[0]["extras"]["lightmap"], uvs
