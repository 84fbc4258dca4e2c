#!/usr/bin/env python3
"""Make what the scenes of textures and environments need: scenes/textures/tiles.png, normals.png, heights.png, sky.hdr, scenes/meshes/bowl.ply, shell.ply.

The picture has 8 x 8 pixels, no two alike; normals and heights are of round bumps, 16 x 16; the environment 32 x 16, with a small sun; the bowl is a part
of a sphere as a binary PLY with texture coordinates and without normals, which loaders then make smooth; the shell the same with colours of its vertices
and faces. Needs nothing but Python.
"""

import math
import os
import struct
import zlib

HERE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "scenes")


def png(path, width, height, pixel):
    rows = b"".join(b"\0" + b"".join(bytes(pixel(x, y)) for x in range(width)) for y in range(height))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def hdr(path, width, height, pixel):
    def rgbe(rgb):
        largest = max(rgb)
        if largest < 1e-30:
            return bytes(4)
        mantissa, exponent = math.frexp(largest)
        scale = mantissa * 256 / largest
        return bytes([min(255, int(c * scale)) for c in rgb] + [exponent + 128])

    with open(path, "wb") as f:
        f.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode())
        for y in range(height):
            row = [rgbe(pixel(x, y)) for x in range(width)]
            f.write(struct.pack(">BBH", 2, 2, width))
            for channel in range(4):
                f.write(bytes([width]) + bytes(p[channel] for p in row))


def slope(x, y):
    """Of round bumps, two along each side of a picture of 16 x 16 pixels."""
    u, v = ((n + 0.5) / 8 * 2 * math.pi for n in (x, y))
    return 0.5 * math.sin(u), 0.5 * math.sin(v)


def normal(x, y):
    n = [*slope(x, y), 1.0]
    length = math.sqrt(sum(c * c for c in n))
    return [round((c / length + 1) * 127.5) for c in n]


def height(x, y):
    u, v = ((n + 0.5) / 8 * 2 * math.pi for n in (x, y))
    return [round(127.5 * (1 - 0.5 * (math.cos(u) + math.cos(v))))] * 3


def bowl(path, rings=8, sectors=16, coloured=False):
    vertices, faces = [], []
    for i in range(rings + 1):
        theta = 0.15 + 1.35 * i / rings
        for j in range(sectors + 1):
            phi = 2 * math.pi * j / sectors
            p = (math.sin(theta) * math.cos(phi), -math.cos(theta), math.sin(theta) * math.sin(phi))
            vertices.append([round(c, 4) for c in p] + [j / sectors * 2, i / rings])
    for i in range(rings):
        for j in range(sectors):
            a, b = i * (sectors + 1) + j, (i + 1) * (sectors + 1) + j
            faces += [(a, b, a + 1), (a + 1, b, b + 1)]
    with open(path, "wb") as f:
        head = f"ply\nformat binary_little_endian 1.0\ncomment made by make_textures.py\nelement vertex {len(vertices)}\n"
        head += "".join(f"property float {name}\n" for name in ["x", "y", "z", "u", "v"])
        if coloured:
            head += "".join(f"property float {name}\n" for name in ["r", "g", "b"])
            vertices = [v + [0.5 + 0.4 * v[0], 0.1 + 0.2 * (k % 4), 0.5 - 0.4 * v[2]] for k, v in enumerate(vertices)]
        head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
        if coloured:
            head += "property float rough_0\n"
        f.write((head + "end_header\n").encode())
        f.write(b"".join(struct.pack(f"<{len(v)}f", *v) for v in vertices))
        for k, t in enumerate(faces):
            f.write(struct.pack("<B3i", 3, *t) + (struct.pack("<f", 0.2 + 0.1 * (k % 3)) if coloured else b""))


def main():
    os.makedirs(os.path.join(HERE, "textures"), exist_ok=True)
    tile = lambda x, y: ((40 + 25 * x + 3 * y) % 256, (230 - 20 * y - 5 * x) % 256, 60 + (x * 37 + y * 59) % 160)
    png(os.path.join(HERE, "textures", "tiles.png"), 8, 8, tile)
    png(os.path.join(HERE, "textures", "normals.png"), 16, 16, normal)
    png(os.path.join(HERE, "textures", "heights.png"), 16, 16, height)

    def sky(x, y):
        height = math.cos(math.pi * y / 15)
        blue = [0.3 + 0.2 * height, 0.4 + 0.2 * height, 0.6 + 0.3 * height] if height > 0 else [0.2, 0.15, 0.1]
        return [c + 40.0 for c in blue] if (x, y) in ((9, 4), (10, 4)) else blue

    hdr(os.path.join(HERE, "textures", "sky.hdr"), 32, 16, sky)
    bowl(os.path.join(HERE, "meshes", "bowl.ply"))
    bowl(os.path.join(HERE, "meshes", "shell.ply"), coloured=True)


if __name__ == "__main__":
    main()
