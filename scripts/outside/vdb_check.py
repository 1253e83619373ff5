"""Reads .vdb files with OpenVDB itself: vdb_check.py CLOUD.vdb CLOUD.npy [TREE.vdb]

CLOUD.vdb must hold the very bits of CLOUD.npy, at the place that its .json names. TREE.vdb is what tests/voxelize.rs leaves
behind, whose values come from the generator below.
"""
import json
import sys

import numpy as np
import pyopenvdb as vdb


def grid_of(path):
    grids = vdb.readAllGridMetadata(path)
    assert [grid.name for grid in grids] == ["density"], grids
    grid = vdb.read(path, "density")
    assert grid.gridClass == "fog volume" and grid.background == 0.0
    return grid


grid, array = grid_of(sys.argv[1]), np.load(sys.argv[2])
side = json.load(open(sys.argv[2].rsplit(".", 1)[0] + ".json"))
dense = np.zeros(array.shape[::-1], np.float32)
grid.copyToArray(dense)
assert (dense.transpose(2, 1, 0).view(np.uint32) == array.view(np.uint32)).all(), "values differ"
assert grid.activeVoxelCount() == np.count_nonzero(array) == side["active_voxels"]
first = np.array(side["corner"]) + 0.5 * side["voxel_size"]
assert np.allclose(grid.transform.indexToWorld((0, 0, 0)), first, rtol=0, atol=1e-9)
assert np.allclose(grid.transform.voxelSize(), side["voxel_size"], rtol=1e-15)
print(f"{sys.argv[1]}: {grid.activeVoxelCount()} voxels in {grid.leafCount()} leaves, bit by bit those of {sys.argv[2]}")

if len(sys.argv) > 3:
    grid = grid_of(sys.argv[3])
    access, state, active = grid.getConstAccessor(), 1, 0
    places = [(0, 0, 0), (0, 0, 3), (3, 15, 15), (0, 0, 16), (15, 31, 40), (5, 511, 2), (31, 2, 7), (0, 1, 512), (512, 0, 0)]
    for leaf in places:
        for index in range(512):
            state = (state * 747796405 + 2891336453) % 2**32
            value = np.uint32(0 if state % 3 == 0 else state & 0x007FFFFF | 0x3D000000).view(np.float32)
            voxel = tuple(8 * c + i for c, i in zip(leaf, (index // 64, index // 8 % 8, index % 8)))
            read, on = access.probeValue(voxel)
            assert np.float32(read).view(np.uint32) == value.view(np.uint32) and on == (value != 0), (voxel, read, value)
            active += on
    assert grid.activeVoxelCount() == active and grid.leafCount() == len(places)
    print(f"{sys.argv[3]}: {active} voxels in {len(places)} leaves, all as written")
print(f"read by OpenVDB {'.'.join(map(str, vdb.LIBRARY_VERSION))}")
