"""Renders a volume of `welkin voxelize` in Mitsuba 3, as docs/outside-renderers.md says.

mitsuba_render.py CLOUD.npy OUT.npy WIDTH HEIGHT SPP [nearest|trilinear] [SEED]
"""
import json
import sys
import time

import numpy as np
import mitsuba as mi

cloud, out, width, height, spp = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6])
filter_type = sys.argv[6] if len(sys.argv) > 6 else "trilinear"
seed = int(sys.argv[7]) if len(sys.argv) > 7 else 0
side = json.load(open(cloud.rsplit(".", 1)[0] + ".json"))

mi.set_variant("scalar_rgb")  # needs no LLVM; llvm_ad_rgb and cuda_ad_rgb give the same picture faster
from mitsuba import ScalarTransform4f as T

corner, end = np.array(side["corner"]), np.array(side["end"])
camera, sun, medium = side["camera"], side["sun"], side["medium"]
assert medium["g_single"] == medium["g_multiple"] and medium["phase"] == "henyey-greenstein"
position, forward = np.array(camera["position"]), np.array(camera["forward"])
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 100},
    "sensor": {
        "type": "perspective",
        "fov": camera["fov_y_degrees"],
        "fov_axis": "y",
        "near_clip": 0.1,
        "far_clip": 1e7,
        "to_world": T().look_at(origin=position.tolist(), target=(position + forward).tolist(), up=camera["up"]),
        "film": {
            "type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent", "sample_count": spp},
    },
    "sun": {
        "type": "directional",
        "direction": [-c for c in sun["to_sun"]],
        "irradiance": {"type": "rgb", "value": sun["irradiance"]},
    },
    "cloud": {
        "type": "cube",  # from -1 to 1
        "to_world": T().translate((0.5 * (corner + end)).tolist()).scale((0.5 * (end - corner)).tolist()),
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "sigma_t": {
                "type": "gridvolume",  # from 0 to 1; the array is [z][y][x][channel]
                "grid": mi.VolumeGrid(np.load(cloud)[..., None]),
                "to_world": T().translate(corner.tolist()).scale((end - corner).tolist()),
                "filter_type": filter_type,
                "wrap_mode": "clamp",
                "raw": True,
            },
            "albedo": {"type": "constvolume", "value": {"type": "rgb", "value": [medium["albedo"]] * 3}},
            "phase": {"type": "hg", "g": medium["g_single"]},
            "scale": 1.0,
        },
    },
})
start = time.time()
# Several seeds, so that the spread tells the noise.
parts = [np.array(mi.render(scene, spp=spp // 8, seed=seed * 8 + k)) for k in range(8)]
np.save(out, np.mean(parts, axis=0).astype(np.float32))
np.save(out.rsplit(".", 1)[0] + ".variance.npy", (np.var(parts, axis=0, ddof=1) / 8).astype(np.float32))
print(f"mitsuba {mi.__version__}: {width}x{height}, {spp} samples, {time.time() - start:.0f} s", file=sys.stderr)
