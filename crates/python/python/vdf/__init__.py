"""vdf renders fog, smoke and haze, and proves that shadow segments are unoccluded.

See the docstrings of :func:`load`, :class:`Scene` and :class:`Visibility`.
"""

from ._vdf import Rendering, Scene, Visibility, __version__, compare, load, read_exr, write_exr

__all__ = ["Rendering", "Scene", "Visibility", "__version__", "compare", "load", "read_exr", "write_exr"]
