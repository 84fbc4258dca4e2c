from os import PathLike
from typing import Any, Literal, Sequence

import numpy as np
from numpy.typing import NDArray

__version__: str

Layer = Literal["albedo", "normal", "depth", "position", "variance", "samples", "cost", "unknown"]

def load(path: str | PathLike[str], *, sensor: int | None = None, **params: str | int | float | bool) -> Scene:
    """Load a scene file (a subset of Mitsuba 3 XML), or a built-in scene by its name.

    Keyword arguments are the scene's ``$`` parameters, as ``-D`` on the command line: ``load("cbox_vol2", width=64)``.
    ``sensor`` is the number of the camera in the file, from 0.

    Raises ValueError with file, line and column if the scene is not understood.
    """

class Scene:
    """A scene. What a render builds is kept: the next one with the same method builds nothing."""

    @property
    def name(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the full film in pixels."""
    @property
    def spp(self) -> int:
        """Samples per pixel that the scene asks for."""
    @property
    def triangles(self) -> int:
        """Triangles that occlude."""
    @property
    def checksum(self) -> int:
        """CRC-32 of the scene as it is rendered; ``vdf.sceneHash`` of an EXR."""
    @property
    def warnings(self) -> list[str]:
        """What is legal but probably not meant, with file and line."""
    def render(
        self,
        *,
        spp: int | None = None,
        seed: int | None = None,
        method: str | None = None,
        integrator: Literal["volpath", "raymarch"] = "volpath",
        samples_per_segment: int | None = None,
        estimator: Literal["thesis", "equiangular"] = "thesis",
        sampler: Literal["independent", "sobol"] = "independent",
        transmittance: Literal["analytic", "analog"] = "analytic",
        roulette: Literal["standard", "thesis"] = "standard",
        voxel: float | None = None,
        crop: tuple[int, int, int, int] | None = None,
        layers: Sequence[Layer] = (),
        threads: int | None = None,
    ) -> Rendering:
        """Render the scene; the image has the bytes that ``vdf render`` gives it.

        What is None is as the scene says, or chosen. ``voxel`` is in world units; ``crop`` is x0, y0, x1, y1 in pixels, with
        x1 and y1 one past the last. Other threads of Python run meanwhile, and Ctrl-C stops it with KeyboardInterrupt.

        Raises ValueError if an option is not usable.
        """

class Rendering:
    """A finished render."""

    @property
    def image(self) -> NDArray[np.float32]:
        """Linear RGB with the primaries of sRGB, of shape (height, width, 3), top row first."""
    @property
    def layers(self) -> dict[str, NDArray[np.float32]]:
        """The layers asked for, each of shape (height, width, channels), as docs/layers.md describes them."""
    @property
    def statistics(self) -> dict[str, Any]:
        """The figures of ``vdf render --stats``: times in seconds, sizes in bytes, counts of queries."""

class Visibility:
    """Proofs that points see lights, for other programs.

    ``triangles``: float32 of shape (n, 3, 3), three vertices each, in world units. ``lights``: float64 of shape (m, 3).
    ``method`` as on the command line (``"lb"`` answers nearly all), chosen by the number of triangles if None; ``voxel`` is the side of a voxel in
    world units for the methods that need one.

    Ctrl-C stops building and asking. Raises ValueError for arrays of other shapes or with numbers that are not finite.
    """

    def __init__(
        self,
        triangles: NDArray[np.float32],
        lights: NDArray[np.float64],
        *,
        method: str | None = None,
        voxel: float | None = None,
        threads: int | None = None,
    ) -> None: ...
    def unoccluded(self, points: NDArray[np.float64], *, light: int | None = None) -> NDArray[np.bool_]:
        """Whether the closed segments from the points to the lights meet no triangle, exactly.

        ``points``: float64 of shape (k, 3), read in place where they are contiguous. The answer has shape (k, m), or (k,)
        with ``light``. Both ends belong to the segment: a point on a triangle sees nothing.

        Other threads of Python run meanwhile. Raises IndexError if there is no such light.
        """
    @property
    def method(self) -> str: ...
    @property
    def statistics(self) -> dict[str, Any]:
        """``method``, ``lights``, ``t_build`` in seconds, ``bytes``, and the ``queries`` so far with those ``proved``."""

def compare(
    image: NDArray[np.float32], reference: NDArray[np.float32], *, pixels_per_degree: float = ...
) -> dict[str, Any]:
    """The figures of ``vdf compare --json`` for two images of shape (height, width, 3): mse, mae, relmse, psnr, ssim, flip_ldr, flip_hdr, identical."""

def read_exr(path: str | PathLike[str]) -> NDArray[np.float32]:
    """The channels R, G and B of an EXR, of shape (height, width, 3)."""

def write_exr(
    path: str | PathLike[str], image: NDArray[np.float32], *, layers: dict[str, NDArray[np.float32]] | None = None
) -> None:
    """Write an EXR of shape (height, width, 3), with layers of shape (height, width, channels). It appears whole or not at all."""
