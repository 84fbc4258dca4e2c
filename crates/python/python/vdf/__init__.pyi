from os import PathLike
from typing import Any, Literal, Sequence, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Rendering", "Scene", "Visibility", "__version__", "compare", "load", "read_exr", "write_exr"]

__version__: str

_Layer = Literal["albedo", "normal", "depth", "position", "variance", "samples", "cost", "unknown"]

def load(path: str | PathLike[str], *, sensor: int | None = None, **params: str | int | float | bool) -> Scene:
    """Load a scene file (a subset of Mitsuba 3 XML), or a built-in scene by its name.

    Keyword arguments are the scene's ``$`` parameters, as ``-D`` on the command line: ``load("cbox_vol2", width=64)``.
    ``sensor`` is the number of the camera in the file, from 0.

    Raises FileNotFoundError if there is neither such a file nor such a scene, and ValueError with file, line and column if the
    scene is not understood.
    """

@final
class Scene:
    """A scene. What a render builds is kept: the next one with the same method builds nothing."""

    @property
    def name(self) -> str:
        """The file's name without its extension, or that of the built-in scene."""
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
        samples_per_segment: int | Literal["auto"] | None = None,
        estimator: Literal["thesis", "equiangular", "lit"] = "equiangular",
        light_paths: Literal["auto", "always", "never"] = "auto",
        sampler: Literal["independent", "sobol"] = "sobol",
        transmittance: Literal["analytic", "analog"] = "analytic",
        roulette: Literal["standard", "thesis"] = "standard",
        voxel: float | None = None,
        crop: tuple[int, int, int, int] | None = None,
        layers: Sequence[_Layer] | None = None,
        noise: float | None = None,
        threads: int | None = None,
    ) -> Rendering:
        """Render the scene; the image has the bytes that ``vdf render`` gives it.

        What is None is as the scene says, or chosen. ``voxel`` is in world units; ``crop`` is x0, y0, x1, y1 in pixels, with
        x1 and y1 one past the last. With a limit of ``noise`` each tile of 16 x 16 pixels gets samples until the standard error of
        its pixels over their mean is below it, and there are the layers variance and samples. Other threads of Python run meanwhile, and Ctrl-C stops it with KeyboardInterrupt.

        Raises ValueError if an option is not usable.
        """

@final
class Rendering:
    """A finished render."""

    @property
    def image(self) -> NDArray[np.float32]:
        """Linear RGB with the primaries of sRGB, float32 of shape (height, width, 3), top row first."""
    @property
    def layers(self) -> dict[str, NDArray[np.float32]]:
        """The layers asked for, each float32 of shape (height, width, channels), as docs/layers.md describes them."""
    @property
    def statistics(self) -> dict[str, Any]:
        """The figures of ``vdf render --stats``: times in seconds, sizes in bytes, counts of queries."""

@final
class Visibility:
    """Proofs that points see lights, for other programs.

    ``triangles``: float32 of shape (n, 3, 3), three vertices each, in world units. ``lights``: float64 of shape (m, 3).
    ``method`` as on the command line (``"lb"`` answers nearly all queries), chosen by the number of triangles if None;
    ``voxel`` is the side of a voxel in world units, for the methods that need one. ``threads``: one for each processor if None.

    Ctrl-C stops building and asking with KeyboardInterrupt. Raises TypeError for arrays of other numbers, and ValueError
    for arrays of other shapes or with numbers that are not finite.
    """

    def __new__(
        cls,
        triangles: NDArray[np.float32],
        lights: NDArray[np.float64],
        *,
        method: str | None = None,
        voxel: float | None = None,
        threads: int | None = None,
    ) -> Visibility: ...
    def unoccluded(self, points: NDArray[np.float64], *, light: int | None = None) -> NDArray[np.bool_]:
        """Whether the closed segments from the points to the lights meet no triangle, exactly.

        ``points``: float64 of shape (k, 3), read in place where they lie one after the other. The answer has shape (k, m), or
        (k,) with the number of a ``light``. Both ends belong to the segment: a point on a triangle sees nothing.

        Other threads of Python run meanwhile; they must not change ``points``. Raises IndexError if there is no such light.
        """
    def lit_intervals(
        self, origins: NDArray[np.float64], ends: NDArray[np.float64], *, light: int | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.int64]]:
        """Where segments see the lights: of each segment and light, the intervals that are not certainly dark.

        ``origins`` and ``ends``: float64 of shape (k, 3), the ends of the segments. Of (k, m) pairs, or of k with the number
        of a ``light``, pair p = i * m + j has the rows offsets[p] to offsets[p + 1] of the answer:

        - ``intervals``: float64 of shape (n, 2), closed intervals of t, where x(t) = origin + (end - origin) * t; disjoint and
          in order,
        - ``lit``: bool of shape (n,), True where every x(t) sees the light, False where nothing is known: ask ``unoccluded``
          there. Guard bands of some 1e-14, and whole segments with too many triangles between them and the light,
        - ``offsets``: int64 of shape (k * m + 1,).

        What is in no interval is occluded. All is exact, as ``unoccluded`` says it of x(t) in double precision. No method is asked,
        but the hierarchy, once a segment and light. Raises IndexError if there is no such light.
        """
    @property
    def method(self) -> str:
        """The name of the method."""
    @property
    def statistics(self) -> dict[str, Any]:
        """``method``, ``lights``, ``t_build`` in seconds, ``bytes``; and of all calls so far ``queries`` with those ``proved``, and
        ``lit_segments``.
        """

def compare(
    image: NDArray[np.float32], reference: NDArray[np.float32], *, pixels_per_degree: float = ...
) -> dict[str, Any]:
    """The figures of ``vdf compare --json`` for two images, float32 of shape (height, width, 3): ``mse``, ``mae``, ``relmse``, ``psnr``
    (None if they are identical), ``ssim``, ``flip_ldr``, ``flip_hdr``, ``identical``.

    Raises ValueError if they differ in size, or a pixel is not finite.
    """

def read_exr(path: str | PathLike[str]) -> NDArray[np.float32]:
    """The channels R, G and B of an EXR, float32 of shape (height, width, 3).

    Raises OSError if the file cannot be read, and ValueError if it is no such EXR.
    """

def write_exr(
    path: str | PathLike[str], image: NDArray[np.float32], *, layers: dict[str, NDArray[np.float32]] | None = None
) -> None:
    """Write an image, float32 of shape (height, width, 3), as an EXR, with layers of shape (height, width, channels) as
    ``Rendering.layers`` has them, or of your own. The file appears whole or not at all.

    Raises OSError if the file cannot be written.
    """
