"""Bakes the irradiance of a lit GLB with Cycles, at rising sample counts, on the texels that the GLB itself names.

    blender --background --factory-startup --python cycles_bake.py -- LIT.glb FOLDER --page-sizes WxH,...
        [--seconds T | --samples N,...]

Runs inside Blender (made with 3.4). The same triangles, TEXCOORD_1 and reflectances as the GLB has, and the same
physics as the project's conventions: a plain Diffuse BSDF, a Principled one for metal, Translucent for paper, Transparent
and Glossy for glass; of paper that lies there twice, turned over, light passes one; the back of a single-sided triangle is black and does not shine; nothing clamped; 128 bounces; no denoiser, no adaptive sampling. Everything else is as Blender starts.

Sample counts grow by four for as long as the next bake should take at most T seconds, or are those named. For each, every page is written as
FOLDER/<samples>.<page>.pfm (irradiance in lux, row 0 = v 0) and a line "bake: {JSON}" is printed: samples, seconds (of
the bake operator: scene set-up included), pages. A GLB without light or pages ends with status 1 and the reason.
"""

import argparse
import json
import math
import struct
import sys
import time
from pathlib import Path

import bpy
import numpy as np

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """The triangles of a GLB in world space. Reads with numpy alone: Blender's importer would change the layout."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        if data[:4] != b"glTF":
            raise ValueError(f"{path}: not a GLB file")
        length = struct.unpack_from("<I", data, 12)[0]
        self.gltf = json.loads(data[20:20 + length])
        self.binary = data[28 + length:]

    def accessor(self, index):
        accessor = self.gltf["accessors"][index]
        if "sparse" in accessor:
            raise ValueError("sparse accessors are not read")
        view = self.gltf["bufferViews"][accessor["bufferView"]]
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        width = WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        return np.ndarray((accessor["count"], width), kind, self.binary, start, (stride, kind.itemsize))

    def matrix(self, node):
        if "matrix" in node:
            return np.array(node["matrix"], float).reshape(4, 4).T
        x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), float)
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        matrix = np.eye(4)
        matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), float)
        matrix[:3, 3] = node.get("translation", (0, 0, 0))
        return matrix

    def primitives(self):
        """Of every primitive in the scene: corners (n x 3 x 3), uvs (n x 3 x 2), and what it is: material or None, page
        or -1, colour, whether it is the back of another one, turned over."""
        scene = self.gltf["scenes"][self.gltf.get("scene", 0)]
        open_nodes = [(index, np.eye(4)) for index in scene.get("nodes", [])]
        while open_nodes:
            index, parent = open_nodes.pop()
            node = self.gltf["nodes"][index]
            world = parent @ self.matrix(node)
            open_nodes += [(child, world) for child in node.get("children", [])]
            for primitive in self.gltf["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
                yield self.triangles(primitive, world)

    def triangles(self, primitive, world):
        attributes = primitive["attributes"]
        position = self.accessor(attributes["POSITION"]).astype(float) @ world[:3, :3].T + world[:3, 3]
        uv = np.zeros((len(position), 2))
        if "TEXCOORD_1" in attributes:
            uv = self.accessor(attributes["TEXCOORD_1"]).astype(float)
        order = np.arange(len(position))
        if "indices" in primitive:
            order = self.accessor(primitive["indices"]).astype(int).ravel()
        order = order[:len(order) // 3 * 3].reshape(-1, 3)
        if np.linalg.det(world[:3, :3]) < 0:
            order = order[:, ::-1]
        extras = primitive.get("extras", {})
        is_back = extras.get("lightmapSide") == "back"
        return position[order], uv[order], (primitive.get("material"), extras.get("lightmap", -1), self.colour(attributes), is_back)

    def colour(self, attributes):
        """The one vertex colour of a primitive. Several cannot be had: the reference has no scene of that kind either."""
        if "COLOR_0" not in attributes:
            return (1.0, 1.0, 1.0)
        values = self.accessor(attributes["COLOR_0"])
        colours = np.unique(values[:, :3] / (np.iinfo(values.dtype).max if values.dtype != np.float32 else 1.0), axis=0)
        if len(colours) != 1:
            raise ValueError("a primitive has several vertex colours")
        return tuple(float(channel) for channel in colours[0])


class Material:
    """What the project's conventions make of a material, or of none."""

    def __init__(self, gltf, index, colour):
        material = gltf["materials"][index] if index is not None else {"pbrMetallicRoughness": {"metallicFactor": 0}}
        extensions = material.get("extensions", {})
        pbr = material.get("pbrMetallicRoughness", {})
        glass = extensions.get("KHR_materials_transmission", {})
        if "baseColorTexture" in pbr or "emissiveTexture" in material or "metallicRoughnessTexture" in pbr or "transmissionTexture" in glass:
            raise ValueError("textures are not baked")
        if material.get("alphaMode", "OPAQUE") != "OPAQUE":
            raise ValueError("surfaces with holes are not baked")
        base = np.minimum(np.array(pbr.get("baseColorFactor", (1, 1, 1, 1))[:3], float) * colour, 0.999)
        metallic = pbr.get("metallicFactor", 1.0)
        if 0 < metallic < 1:
            raise ValueError("half metals are not baked")
        self.is_metal = metallic == 1
        self.is_glass = glass.get("transmissionFactor", 0) > 0 and not self.is_metal  # which passes nothing
        if self.is_glass and glass["transmissionFactor"] < 1:
            raise ValueError("only glass is baked that scatters nothing")
        if self.is_glass and ("KHR_materials_volume" in extensions or extensions.get("KHR_materials_ior", {}).get("ior", 1.5) != 1.5):
            raise ValueError("only thin glass with an index of 1.5 is baked")
        self.base, self.roughness = base, pbr.get("roughnessFactor", 1.0)
        paper = extensions.get("KHR_materials_diffuse_transmission", {})
        passing = paper.get("diffuseTransmissionFactor", 0.0)
        is_diffuse = not (self.is_metal or self.is_glass)
        self.reflectance = is_diffuse * (1 - passing) * base
        self.transmittance = is_diffuse * passing * np.array(paper.get("diffuseTransmissionColorFactor", (1, 1, 1)), float)
        strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        self.nits = strength * np.array(material.get("emissiveFactor", (0, 0, 0)), float)
        if self.transmittance.max() > 0 and base.min() < 1e-3:
            raise ValueError("paper whose base colour lacks a channel is not baked")
        self.double_sided = material.get("doubleSided", False) or self.is_glass
        self.passes = self.is_glass or self.transmittance.max() > 0


class Shader:
    """Puts nodes together."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.nodes, self.link = self.material.node_tree.nodes, self.material.node_tree.links.new
        self.nodes.clear()

    def bsdf(self, kind, colour, **inputs):
        node = self.nodes.new(kind)
        node.inputs[0].default_value = (*colour, 1)
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node.outputs[0]

    def add(self, a, b):
        node = self.nodes.new("ShaderNodeAddShader")
        self.link(a, node.inputs[0])
        self.link(b, node.inputs[1])
        return node.outputs[0]

    def mix(self, part, a, b):
        node = self.nodes.new("ShaderNodeMixShader")
        for i, socket in enumerate((part, a, b)):
            self.link(socket, node.inputs[i])
        return node.outputs[0]

    def math(self, operation, *operands):
        node = self.nodes.new("ShaderNodeMath")
        node.operation = operation
        for i, operand in enumerate(operands):
            if isinstance(operand, float):
                node.inputs[i].default_value = operand
            else:
                self.link(operand, node.inputs[i])
        return node.outputs[0]

    def schlick(self, facing):
        """Alike from both sides, which Blender's own node is not."""
        geometry = self.nodes.new("ShaderNodeNewGeometry")
        product = self.nodes.new("ShaderNodeVectorMath")
        product.operation = "DOT_PRODUCT"
        self.link(geometry.outputs["Normal"], product.inputs[0])
        self.link(geometry.outputs["Incoming"], product.inputs[1])
        edge = self.math("POWER", self.math("SUBTRACT", 1.0, self.math("ABSOLUTE", product.outputs["Value"])), 5.0)
        return self.math("MULTIPLY_ADD", edge, 1.0 - facing, facing)


def surface_of(shader, look):
    """Metal is GGX by Schlick's law; a face of glass one interface, also by Schlick's, behind which light goes straight on, tinted."""
    if look.is_metal:
        metal = shader.bsdf("ShaderNodeBsdfPrincipled", look.base, Metallic=1.0, Roughness=look.roughness)
        metal.node.distribution = "MULTI_GGX"
        return metal
    if look.is_glass:
        passes = shader.bsdf("ShaderNodeBsdfTransparent", look.base)
        return shader.mix(shader.schlick(0.04), passes, shader.bsdf("ShaderNodeBsdfGlossy", (1, 1, 1), Roughness=look.roughness))
    surface = shader.bsdf("ShaderNodeBsdfDiffuse", look.reflectance, Roughness=0.0)
    if look.transmittance.max() > 0:
        surface = shader.add(surface, shader.bsdf("ShaderNodeBsdfTranslucent", look.transmittance))
    return surface


def baked_of(shader, look):
    """What texels are baked of: white, whatever they reflect, so that their light is what arrives. Of paper they hold
    the light of both sides, by what its base colour would make of it."""
    if look.transmittance.max() == 0:
        return shader.bsdf("ShaderNodeBsdfDiffuse", (1, 1, 1), Roughness=0.0)
    return shader.add(shader.bsdf("ShaderNodeBsdfDiffuse", look.reflectance / look.base, Roughness=0.0),
                      shader.bsdf("ShaderNodeBsdfTranslucent", look.transmittance / look.base))


def make_material(name, look, image, is_twin):
    """`is_twin`: another sheet lies in the same place, turned over, which is not to be passed once more."""
    shader = Shader(name)
    nodes, link = shader.nodes, shader.link
    output = nodes.new("ShaderNodeOutputMaterial")
    surface = surface_of(shader, look)
    if look.nits.max() > 0:
        shine = shader.bsdf("ShaderNodeEmission", look.nits / look.nits.max(), Strength=look.nits.max())
        surface = shader.add(surface, shine)
    surface = shader.mix(nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], surface, baked_of(shader, look))
    if is_twin or not look.double_sided:
        back = shader.bsdf("ShaderNodeBsdfTransparent", (1, 1, 1)) if is_twin else shader.bsdf("ShaderNodeBsdfDiffuse", (0, 0, 0))
        surface = shader.mix(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], surface, back)
    link(surface, output.inputs["Surface"])
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    nodes.active = texture  # where the bake goes
    return shader.material


def make_mesh(corners, uvs, material_of):
    """One object with every triangle on its own three vertices."""
    count = len(corners)
    mesh = bpy.data.meshes.new("scene")
    mesh.vertices.add(3 * count)
    mesh.loops.add(3 * count)
    mesh.polygons.add(count)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(3 * count, dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(count, 3, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", material_of.astype(np.int32))
    mesh.uv_layers.new(name="lightmap").data.foreach_set("uv", uvs.astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    placed = bpy.data.objects.new("scene", mesh)
    bpy.context.scene.collection.objects.link(placed)
    bpy.context.view_layer.objects.active = placed
    placed.select_set(True)
    return mesh


def keys_of(corners):
    """The same for triangles with the same corners, whatever their order."""
    return [tuple(sorted(tuple(corner) for corner in triangle)) for triangle in np.round(corners, 5).tolist()]


def apart(corners):
    """Triangles, so much farther to their front that single precision can tell, in scenes of some tens of metres."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return corners + (2e-5 * normals / np.maximum(lengths, 1e-30))[:, None, :]


def load(path, sizes):
    """Builds the Blender scene; returns the images of the pages."""
    for old in list(bpy.data.objects):
        bpy.data.objects.remove(old)
    glb = Glb(path)
    if glb.gltf.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights"):
        raise ValueError("lights without extent are not baked")
    if "radiositySky" in (glb.gltf.get("extras") or {}):
        raise ValueError("a sky is not baked")
    parts = list(glb.primitives())
    pages = 1 + max((part[2][1] for part in parts), default=-1)
    if pages < 1:
        raise ValueError("no primitive names a lightmap page")
    if len(sizes) != pages:
        raise ValueError(f"{pages} pages, but {len(sizes)} sizes")
    images = []
    for page, (width, height) in enumerate(sizes):
        images.append(bpy.data.images.new(f"page {page}", width, height, float_buffer=True, is_data=True))
    spare = bpy.data.images.new("no page", 4, 4, float_buffer=True, is_data=True)
    looks = [Material(glb.gltf, material, colour) for _, _, (material, _, colour, _) in parts]
    # Sheets that pass light and lie there twice, as the lit GLB has those with light on both sides, are moved apart.
    backs = {key for part, look in zip(parts, looks) if part[2][3] and look.passes for key in keys_of(part[0])}
    twins = []
    for part, look in zip(parts, looks):
        found = [key in backs for key in keys_of(part[0])] if look.passes and backs else []
        if any(found) and not all(found):
            raise ValueError("paper of which some triangles alone have light on both sides is not baked")
        twins.append(any(found))
    slot = [(-1 if material is None else material, page, colour, is_twin)
            for (_, _, (material, page, colour, _)), is_twin in zip(parts, twins)]
    slots = sorted(set(slot))
    corners = np.concatenate([apart(part[0]) if own[3] else part[0] for part, own in zip(parts, slot)])
    uvs = np.concatenate([part[1] for part in parts])
    slot_of = np.concatenate([np.full(len(part[0]), slots.index(own)) for part, own in zip(parts, slot)])
    edges = corners[:, 1:] - corners[:, :1]
    real = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) > 0
    mesh = make_mesh(corners[real], uvs[real], slot_of[real])
    shines = False
    for material, page, colour, is_twin in slots:
        look = Material(glb.gltf, None if material < 0 else material, colour)
        shines = shines or look.nits.max() > 0
        image = images[page] if page >= 0 else spare
        mesh.materials.append(make_material(f"{material}.{page}", look, image, is_twin))
    if not shines:
        raise ValueError("no surface shines")
    return images


def set_up():
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 128
    cycles.transparent_max_bounces = 128
    cycles.blur_glossy = 0.0
    cycles.seed = 1
    scene.world = bpy.data.worlds.new("black")
    scene.world.color = (0, 0, 0)


def write_pfm(path, image):
    """A Portable FloatMap holds its rows bottom first; row 0 of ours, v 0, is the top one."""
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    lux = math.pi * pixels.reshape(height, width, 4)[::-1, :, :3]  # Blender's row 0 lies at its v 0, which is our v 0
    path.write_bytes(b"PF\n%d %d\n-1.0\n" % (width, height) + lux.astype("<f4").tobytes())


def bake(samples, images, folder):
    bpy.context.scene.cycles.samples = samples
    start = time.perf_counter()
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT", "COLOR"}, margin=0, use_clear=True)
    seconds = time.perf_counter() - start
    pages = []
    for page, image in enumerate(images):
        pages.append(f"{samples}.{page}.pfm")
        write_pfm(folder / pages[-1], image)
    print("bake:", json.dumps({"samples": samples, "seconds": seconds, "pages": pages}), flush=True)
    return seconds


def main():
    parser = argparse.ArgumentParser(prog="cycles_bake.py")
    parser.add_argument("glb")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=20.0, help="of the longest bake, about")
    parser.add_argument("--samples", default="", help="of each bake, by commas, however long they take")
    parser.add_argument("--page-sizes", required=True, help="WxH of every page, by commas")
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    sizes = [tuple(int(side) for side in size.split("x")) for size in arguments.page_sizes.split(",")]
    arguments.folder.mkdir(parents=True, exist_ok=True)
    set_up()
    images = load(arguments.glb, sizes)
    print("bake:", json.dumps({"version": bpy.app.version_string, "triangles": len(bpy.context.object.data.polygons)}), flush=True)
    for samples in filter(None, arguments.samples.split(",")):
        bake(int(samples), images, arguments.folder)
    if arguments.samples:
        return
    samples, first, last = 1, 0.0, 0.0
    while samples <= 65536 and first + 4 * (last - first) <= arguments.seconds:
        last = bake(samples, images, arguments.folder)
        first = first or last  # nearly all set-up
        samples *= 4


try:
    main()
except Exception as error:  # Blender would go on and exit with 0
    print(f"cycles_bake.py: {error}", file=sys.stderr)
    sys.exit(1)
