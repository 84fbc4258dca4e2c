#!/usr/bin/env python3
"""Make scenes/meshes/rock.obj: a bumpy closed surface of 2000 triangles.

A geodesic sphere, every edge of the icosahedron cut in ten, each vertex moved
along its radius by a sum of waves. It is concave in places, so that it
shadows itself. Four decimals are written, so that the file does not depend on
the last digits of a platform's sine.
"""

import itertools
import math
import os

HERE = os.path.dirname(os.path.abspath(__file__))
PARTS = 10
# (amplitude, wave vector, phase) of each wave.
WAVES = [
    (0.16, (2.1, -1.3, 2.6), 0.4),
    (0.11, (-3.7, 2.9, 1.9), 1.7),
    (0.07, (4.3, 5.9, -3.1), 2.9),
    (0.04, (-8.3, 4.7, 7.9), 5.1),
]


def icosahedron():
    g = (1 + math.sqrt(5)) / 2
    corners = [p for a, b in itertools.product((-1, 1), (-g, g)) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    # Edges have length 2; three corners that are all neighbours are a face.
    near = lambda p, q: abs(math.dist(p, q) - 2) < 1e-9
    for a, b, c in itertools.combinations(corners, 3):
        if near(a, b) and near(b, c) and near(c, a):
            normal = [(b[i - 2] - a[i - 2]) * (c[i - 1] - a[i - 1]) - (b[i - 1] - a[i - 1]) * (c[i - 2] - a[i - 2]) for i in range(3)]
            outwards = sum(n * p for n, p in zip(normal, a)) > 0
            yield (a, b, c) if outwards else (a, c, b)


def moved(p):
    length = math.hypot(*p)
    d = [x / length for x in p]
    radius = 0.8 + sum(a * math.sin(sum(k * x for k, x in zip(wave, d)) + phase) for a, wave, phase in WAVES)
    return tuple(radius * x for x in d)


def rock():
    vertices, number, faces = [], {}, []

    def vertex(corners, i, j, k):
        p = [(i * a + j * b + k * c) / PARTS for a, b, c in zip(*corners)]
        key = tuple(round(x * 1e6) for x in p)
        if key not in number:
            vertices.append(moved(p))
            number[key] = len(vertices)
        return number[key]

    for corners in icosahedron():
        for i in range(PARTS):
            for j in range(PARTS - i):
                k = PARTS - 1 - i - j
                at = lambda di, dj, dk: vertex(corners, i + di, j + dj, k + dk)
                faces.append((at(1, 0, 0), at(0, 1, 0), at(0, 0, 1)))
                if k > 0:
                    # The triangle beside it, upside down.
                    faces.append((at(1, 1, -1), at(0, 1, 0), at(1, 0, 0)))
    return vertices, faces


def main():
    vertices, faces = rock()
    with open(os.path.join(HERE, "scenes", "meshes", "rock.obj"), "w") as f:
        f.write("# made by make_meshes.py\n")
        f.writelines("v %.4f %.4f %.4f\n" % v for v in vertices)
        f.writelines("f %d %d %d\n" % t for t in faces)
    print(f"{len(vertices)} vertices, {len(faces)} triangles")


if __name__ == "__main__":
    main()
