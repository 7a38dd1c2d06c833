"""Makes scene.blend of the files in this folder: the scene, with its lightmaps as light.

    blender --background --factory-startup --python make_blend.py

`radiosity` runs this where Blender is installed. Tested with Blender 3.4.1. Surfaces shine with the light of their
lightmap, in nits, so that Cycles and Eevee show them at once; their Principled BSDF stays, for what they reflect as metal or
let through. Lamps that are in the lightmaps are gone; the empties in their places have them as the property bakedLight.
"""

import json
import math
from pathlib import Path

import bpy
import numpy
from mathutils import Vector

FOLDER = Path(__file__).resolve().parent

# The importer of Blender 3.4 names numpy.bool, which the numpy of Debian 12 no longer has.
if "bool" not in vars(numpy):
    numpy.bool = bool


class LitMaterial:
    """Puts the light of a lightmap into the nodes of a material as the glTF importer makes them."""

    def __init__(self, material, image, lux_of_one):
        self.tree = material.node_tree
        self.material = material
        self.principled = next((node for node in self.tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
        self.output = next((node for node in self.tree.nodes if node.type == "OUTPUT_MATERIAL"), None)
        self.image, self.lux_of_one = image, lux_of_one

    def light(self):
        if self.principled is None or self.output is None:
            return
        lit = self.add("ShaderNodeEmission", Color=self.scaled(self.product(self.take("Base Color"), self.lightmap()),
                                                              self.lux_of_one / math.pi))
        shows_through = self.share_of_principled()
        alpha = self.take("Alpha", 1.0)
        emission = self.emission()
        if shows_through is not None:
            lit = self.mix(shows_through, lit, self.principled.outputs[0])
        if emission is not None:
            lit = self.add("ShaderNodeAddShader", lit, emission)
        if not self.is_constant(alpha, 1.0):
            if self.material.blend_method == "CLIP":
                alpha = self.math("GREATER_THAN", alpha, self.material.alpha_threshold)
            lit = self.mix(alpha, self.add("ShaderNodeBsdfTransparent"), lit)
        if self.material.use_backface_culling:
            back = self.tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
            lit = self.mix(back, lit, self.add("ShaderNodeBsdfTransparent"))
        self.tree.links.new(lit, self.output.inputs["Surface"])

    def lightmap(self):
        place = self.tree.nodes.new("ShaderNodeUVMap")
        place.uv_map = "UVMap.001"  # TEXCOORD_1
        texture = self.tree.nodes.new("ShaderNodeTexImage")
        texture.image, texture.extension, texture.label = self.image, "EXTEND", "Lightmap"
        self.tree.links.new(place.outputs[0], texture.inputs[0])
        return texture.outputs["Color"]

    def emission(self):
        """What the surface sends by itself; the Principled BSDF keeps none of it."""
        name = "Emission" if "Emission" in self.principled.inputs else "Emission Color"
        colour, strength = self.take(name), self.take("Emission Strength", 0.0)
        if self.is_constant(strength, 0.0) or (not self.is_socket(colour) and max(colour[:3]) == 0):
            return None
        return self.add("ShaderNodeEmission", Color=colour, Strength=strength)

    def share_of_principled(self):
        """Of metal, and of what lets light through: no lightmap holds what these show. None: there is no such part."""
        parts = [name for name in ("Metallic", "Transmission", "Transmission Weight") if name in self.principled.inputs]
        rest = None
        for value in (self.value(name) for name in parts):
            if self.is_constant(value, 0.0):
                continue
            other = self.math("SUBTRACT", 1.0, value)
            rest = other if rest is None else self.math("MULTIPLY", rest, other)
        return None if rest is None else self.math("SUBTRACT", 1.0, rest)

    def value(self, name):
        """What feeds an input: a socket, or the value it has."""
        socket = self.principled.inputs[name]
        if socket.is_linked:
            return socket.links[0].from_socket
        value = socket.default_value
        return value if isinstance(value, float) else tuple(value)

    def take(self, name, left=None):
        """The same; the input has the value `left` from now on, if there is one."""
        value = self.value(name)
        if left is not None:
            socket = self.principled.inputs[name]
            for link in list(socket.links):
                self.tree.links.remove(link)
            socket.default_value = left
        return value

    @staticmethod
    def is_socket(value):
        return isinstance(value, bpy.types.NodeSocket)

    def is_constant(self, value, number):
        return not self.is_socket(value) and value == number

    def feed(self, socket, value):
        if self.is_socket(value):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def add(self, kind, *shaders, **inputs):
        node = self.tree.nodes.new(kind)
        for i, shader in enumerate(shaders):
            self.tree.links.new(shader, node.inputs[i])
        for name, value in inputs.items():
            self.feed(node.inputs[name], value)
        return node.outputs[0]

    def mix(self, share, first, second):
        node = self.tree.nodes.new("ShaderNodeMixShader")
        self.feed(node.inputs[0], share)
        self.tree.links.new(first, node.inputs[1])
        self.tree.links.new(second, node.inputs[2])
        return node.outputs[0]

    def math(self, operation, first, second):
        node = self.tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        self.feed(node.inputs[0], first)
        self.feed(node.inputs[1], second)
        return node.outputs[0]

    def vector(self, operation):
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        return node

    def product(self, first, second):
        node = self.vector("MULTIPLY")
        self.feed(node.inputs[0], first if self.is_socket(first) else first[:3])
        self.feed(node.inputs[1], second)
        return node.outputs["Vector"]

    def scaled(self, vector, factor):
        node = self.vector("SCALE")
        self.feed(node.inputs[0], vector)
        node.inputs["Scale"].default_value = factor
        return node.outputs["Vector"]


def part_sides():
    """Front and back of a sheet are two meshes in one place, each seen from its own side. Cycles would miss one of them
    behind the other's back, so that all are moved a little outwards."""
    size = max((abs(value) for point in corners() for value in point), default=1.0)
    users = {thing.data: thing for thing in bpy.context.scene.objects if thing.type == "MESH"}
    for mesh, user in users.items():
        step = 1e-5 * size / max(max(user.matrix_world.to_scale()), 1e-12)
        # All at once: a vertex that is moved by itself makes Blender find the normals of the whole mesh anew.
        points, normals = (numpy.empty(3 * len(mesh.vertices), numpy.float32) for _ in range(2))
        mesh.vertices.foreach_get("co", points)
        mesh.vertices.foreach_get("normal", normals)
        mesh.vertices.foreach_set("co", points + numpy.float32(step) * normals)
        mesh.update()


def load_page(page):
    image = bpy.data.images.load(str(FOLDER / page["file"]))
    image.colorspace_settings.name = "Non-Color"  # linear as it is
    image.filepath = "//" + page["file"]
    return image


def corners():
    """Of all meshes' boxes, in the world."""
    meshes = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
    return [thing.matrix_world @ Vector(corner) for thing in meshes for corner in thing.bound_box]


def choose_camera():
    """The scene's first camera, or one that frames the scene."""
    scene = bpy.context.scene
    points = corners()
    low = Vector([min(point[axis] for point in points) for axis in range(3)])
    high = Vector([max(point[axis] for point in points) for axis in range(3)])
    radius = max((high - low).length / 2, 1e-6)
    camera = next((thing for thing in scene.objects if thing.type == "CAMERA"), None)
    if camera is None:
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(camera)
        towards = Vector((0.6, -1.0, 0.4)).normalized()
        camera.location = (low + high) / 2 + 2.6 * radius * towards
        camera.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()
        camera.data.clip_start, camera.data.clip_end = radius / 1000, 20 * radius
    scene.camera = camera


def set_scene_up(exposure):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"  # needs no graphics card; Eevee shows the same
    scene.cycles.samples = 16  # no light is left to be looked for but in metal and glass
    scene.cycles.use_denoising = False
    scene.view_settings.exposure = math.log2(exposure)
    world = bpy.data.worlds.new("World")
    world.color = (0, 0, 0)
    scene.world = world


def main():
    about = json.loads((FOLDER / "lighting.json").read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(FOLDER / about["scene"]))
    images = [load_page(page) for page in about["lightmaps"]]
    for material in bpy.data.materials:
        page = material.get("lightmap", -1)
        if isinstance(page, int) and 0 <= page < len(images):
            LitMaterial(material, images[page], about["lightmaps"][page]["luxOfOne"]).light()
    bpy.context.view_layer.update()
    part_sides()
    choose_camera()
    set_scene_up(about["exposure"])
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "scene.blend"), compress=True)


main()
