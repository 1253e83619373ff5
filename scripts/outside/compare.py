"""Compares a picture of an outside renderer with `welkin reference`: compare.py REFERENCE.npy OTHER.npy [PICTURE.png]

Both have a .variance.npy beside them. The noise of both is taken out of the squared difference, so what is left is the
difference of what was rendered; its standard error is found by resampling pixels. Exit status 1 if the mean is more than four
standard errors and 1 % from the reference's. With PICTURE.png: reference, other, and difference (grey is none), side by side.
"""
import sys

import numpy as np

a, b = np.load(sys.argv[1]).astype(float), np.load(sys.argv[2]).astype(float)
noise = [np.load(name.rsplit(".", 1)[0] + ".variance.npy").astype(float) for name in sys.argv[1:3]]
assert a.shape == b.shape, (a.shape, b.shape)
cloud = a.max(axis=2) > 0

ratio = b.sum() / a.sum()
error = ratio * np.sqrt(sum(n.sum() / x.sum() ** 2 for n, x in zip(noise, (a, b))))
print(f"mean: {ratio:.4f} of the reference, standard error {error:.4f}")

power = (a[cloud] ** 2).mean()
squared, expected = ((a - b) ** 2)[cloud] / power, (noise[0] + noise[1])[cloud] / power
random = np.random.default_rng(1)
picks = random.integers(0, len(squared), (1000, len(squared)))
spread = (squared - expected).mean(axis=1)[picks].mean(axis=1).std()
print(
    f"mean square difference {squared.mean():.5f}, noise {expected.mean():.5f}; "
    f"left {(squared - expected).mean():.5f}, standard error {spread:.5f} (of the reference's mean square)"
)
if len(sys.argv) > 3:
    import struct
    import zlib

    white = np.percentile(a[cloud], 97)
    encode = lambda x: np.clip(x, 0, 1) ** (1 / 2.2)
    picture = np.concatenate([encode(a / white), encode(b / white), np.clip(0.5 + (b - a) / white, 0, 1)], axis=1)
    picture = np.repeat(np.repeat((picture * 255).astype(np.uint8), 4, 0), 4, 1)
    height, width, _ = picture.shape
    rows = b"".join(b"\0" + row.tobytes() for row in picture)
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(sys.argv[3], "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
sys.exit(int(abs(ratio - 1) > max(4 * error, 0.01)))
