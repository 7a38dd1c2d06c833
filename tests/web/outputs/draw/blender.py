"""Renders a .blend as it is, from its camera: blender --background FILE --python blender.py -- OUT.exr WIDTH HEIGHT"""

import sys

import bpy

out, width, height = sys.argv[sys.argv.index("--") + 1:]
scene = bpy.context.scene
render = scene.render
render.resolution_x, render.resolution_y, render.resolution_percentage = int(width), int(height), 100
scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01  # the middle of each pixel, as the path tracer
render.image_settings.file_format = "OPEN_EXR"
render.image_settings.color_mode = "RGBA"
render.image_settings.color_depth = "32"
render.image_settings.exr_codec = "NONE"
render.filepath = out
bpy.ops.render.render(write_still=True)
