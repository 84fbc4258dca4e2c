#!/usr/bin/env python3
"""Make what the scenes of grids need: scenes/volumes/puff.vol, blocks.vol, tint.vol and haze.vol.

A puff of 9 x 8 x 7 values that is empty on one side, 3 x 4 x 2 blocks, and colours on 2 x 3 x 4 and 5 x 4 x 3 places, of an albedo and of an extinction. Needs nothing but Python.
"""

import os
import struct

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "scenes", "volumes")


def write(name, size, box, value):
    x, y, z = size
    values = [value(i, j, k) for k in range(z) for j in range(y) for i in range(x)]
    channels = len(values[0])
    os.makedirs(FOLDER, exist_ok=True)
    with open(os.path.join(FOLDER, name), "wb") as f:
        f.write(b"VOL\x03" + struct.pack("<5i", 1, x, y, z, channels) + struct.pack("<6f", *box))
        f.write(struct.pack(f"<{len(values) * channels}f", *(round(c, 4) for v in values for c in v)))


def puff(i, j, k):
    x, y, z = i / 4 - 1, j / 3.5 - 1, k / 3 - 1
    inside = 1 - x * x - y * y - z * z + 0.3 * ((3 * i + 5 * j + 7 * k) % 4 - 1.5)
    return (max(inside, 0) if i < 7 else 0,)


write("puff.vol", (9, 8, 7), (-1, 0, -1, 1, 1.6, 1), puff)
write("blocks.vol", (3, 4, 2), (-0.7, 0.1, -0.5, 0.5, 1.3, 0.5), lambda i, j, k: ((i + 2 * j + 3 * k) % 4 / 3,))
write("tint.vol", (2, 3, 4), (0, 0, 0, 1, 1, 1), lambda i, j, k: (0.95 - 0.2 * i, 0.5 + 0.2 * j, 0.9 - 0.15 * k))
write("haze.vol", (5, 4, 3), (-1, 0, -1, 1, 1.6, 1), lambda i, j, k: (0.25 * i, 0.2 + 0.2 * ((i + j) % 3), 0.9 - 0.4 * k))
