"""Denoises a picture with Open Image Denoise, guided by the layers that vdf wrote into its EXR.

    vdf render scene.xml --aov albedo,normal --exr-format float -o noisy.exr
    pip install pyoidn OpenEXR
    python examples/python/denoise.py noisy.exr denoised.exr

In fog albedo and normal are those of the surface behind it. They are free of noise but for the edges of pixels, so they are taken as clean.
"""

import sys

import numpy as np
import OpenEXR
from pyoidn.denoise import denoise


def main(source, target):
    file = OpenEXR.File(source, separate_channels=True)
    channels = file.channels()

    def layer(*names):
        missing = [name for name in names if name not in channels]
        if missing:
            sys.exit(f"{source} has no channel {missing[0]}: render it with --aov albedo,normal")
        return np.ascontiguousarray(np.stack([channels[name].pixels for name in names], axis=2), dtype=np.float32)

    colour = layer("R", "G", "B")
    albedo = layer("albedo.R", "albedo.G", "albedo.B")
    normal = layer("normal.X", "normal.Y", "normal.Z")
    denoised = denoise(colour, albedo=albedo, normal=normal, hdr=True, clean_aux=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(denoised, dtype=np.float32)}).write(target)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
