"""Compares the EXRs in a folder with truth.npy and truth.transmittance.npy as OpenEXR and OpenCV read them."""
import pathlib
import sys

import cv2
import numpy as np
import OpenEXR

folder = pathlib.Path(sys.argv[1])
truth = np.load(folder / "truth.npy")
transmittance = np.load(folder / "truth.transmittance.npy")
compressions = {
    "none": OpenEXR.NO_COMPRESSION, "rle": OpenEXR.RLE_COMPRESSION, "zips": OpenEXR.ZIPS_COMPRESSION,
    "zip": OpenEXR.ZIP_COMPRESSION, "piz": OpenEXR.PIZ_COMPRESSION,
}
count = 0
for path in sorted(folder.glob("*.exr")):
    compression, kind = path.name.split(".")[:2]
    expected = truth if kind == "float" else truth.astype(np.float16)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        assert header["type"] == OpenEXR.scanlineimage, header["type"]
        assert header["compression"] == compressions[compression], header["compression"]
        assert header["lineOrder"] == OpenEXR.INCREASING_Y, header["lineOrder"]
        assert np.allclose(header["chromaticities"], (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290))
        assert header["owner"] == "Welkin" and header["software"].startswith("Welkin "), header
        assert header["scene"] == "scenes/noon.toml sun.azimuth=150", header["scene"]
        assert sorted(channels) == ["B", "G", "R", "transmittance.Y"], sorted(channels)
        for index, name in enumerate("RGB"):
            assert np.array_equal(channels[name].pixels, expected[..., index]), (path.name, name)
        assert np.array_equal(channels["transmittance.Y"].pixels, transmittance), path.name
    bgr = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(bgr[..., 2::-1], expected.astype(np.float32)), ("OpenCV", path.name, bgr.shape)
    count += 1
assert count == 10, count
print(f"check-exr: {count} files come back bit by bit, through OpenEXR {OpenEXR.__version__} and OpenCV {cv2.__version__}")
