"""Renders a volume of `welkin voxelize` in Blender's Cycles, as docs/outside-renderers.md says. Needs the module bpy.

blender_render.py CLOUD.vdb OUT.npy WIDTH HEIGHT SPP
"""
import json
import math
import os
import sys
import tempfile
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector

cloud, out, width, height, spp = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6])
side = json.load(open(cloud.rsplit(".", 1)[0] + ".json"))
camera, sun, medium = side["camera"], side["sun"], side["medium"]
assert medium["g_single"] == medium["g_multiple"] and medium["phase"] == "henyey-greenstein"

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
turn = Matrix.Rotation(math.radians(90.0), 4, "X")  # from +y up to +z up: (x, y, z) becomes (x, -z, y)

volume = bpy.data.volumes.new("cloud")
volume.filepath = os.path.abspath(cloud)
volume.render.precision = "FULL"  # 32-bit floats; half by default
body = bpy.data.objects.new("cloud", volume)
body.matrix_world = turn
scene.collection.objects.link(body)

material = bpy.data.materials.new("cloud")
material.use_nodes = True
nodes = material.node_tree.nodes
nodes.clear()
inside, end = nodes.new("ShaderNodeVolumePrincipled"), nodes.new("ShaderNodeOutputMaterial")
inside.inputs["Density Attribute"].default_value = "density"
inside.inputs["Density"].default_value = 1.0  # values are 1/m, units are metres
inside.inputs["Color"].default_value = [medium["albedo"]] * 3 + [1.0]
inside.inputs["Absorption Color"].default_value = [0.0, 0.0, 0.0, 1.0]  # what is not scattered is absorbed
inside.inputs["Anisotropy"].default_value = medium["g_single"]
material.node_tree.links.new(inside.outputs["Volume"], end.inputs["Volume"])
volume.materials.append(material)

strength = max(sun["irradiance"])
lamp = bpy.data.lights.new("sun", "SUN")
lamp.energy = strength
lamp.color = [c / strength for c in sun["irradiance"]]
lamp.angle = 0.0
light = bpy.data.objects.new("sun", lamp)
to_sun = turn.to_3x3() @ Vector(sun["to_sun"])
light.rotation_mode = "QUATERNION"
light.rotation_quaternion = to_sun.to_track_quat("Z", "Y")  # a sun shines along its own -z
scene.collection.objects.link(light)

lens = bpy.data.cameras.new("camera")
lens.sensor_fit = "VERTICAL"
lens.angle = math.radians(camera["fov_y_degrees"])
lens.clip_start, lens.clip_end = 0.1, 1e6
eye = bpy.data.objects.new("camera", lens)
axes = [turn.to_3x3() @ Vector(camera[name]) for name in ("right", "up", "forward")]
pose = Matrix((axes[0], axes[1], -axes[2])).transposed().to_4x4()
pose.translation = turn.to_3x3() @ Vector(camera["position"])
eye.matrix_world = pose
scene.collection.objects.link(eye)
scene.camera = eye

scene.world = bpy.data.worlds.new("black")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = [0.0, 0.0, 0.0, 1.0]

scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
cycles = scene.cycles
cycles.device = "CPU"
cycles.use_adaptive_sampling = cycles.use_denoising = False
cycles.max_bounces = cycles.volume_bounces = 1024
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
cycles.light_sampling_threshold = 0.0
cycles.pixel_filter_type = "BOX"
cycles.filter_width = 1.0
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"

start = time.time()
parts = []
with tempfile.TemporaryDirectory() as directory:
    for seed in range(8):  # so that the spread tells the noise
        cycles.seed, cycles.samples = seed, spp // 8
        scene.render.filepath = os.path.join(directory, f"{seed}.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.array(image.pixels[:]).reshape(height, width, -1)[::-1, :, :3]  # from the bottom
        parts.append(pixels)
np.save(out, np.mean(parts, axis=0).astype(np.float32))
np.save(out.rsplit(".", 1)[0] + ".variance.npy", (np.var(parts, axis=0, ddof=1) / 8).astype(np.float32))
print(f"blender {bpy.app.version_string}: {width}x{height}, {spp} samples, {time.time() - start:.0f} s", file=sys.stderr)
