"""Cross-sections of collimated beams, one a file."""

from tetlux.fem.lights.spots.disc import Disc
from tetlux.fem.lights.spots.gaussian import Gaussian
from tetlux.fem.lights.spots.image import Image
from tetlux.fem.lights.spots.rectangle import Rectangle
from tetlux.fem.lights.spots.spot import Spot

# The rays of an immutable spot on a mesh are kept with the mesh; a spot of the user's own may change in between.
IMMUTABLE_SPOTS = (Disc, Gaussian, Rectangle, Image)

__all__ = ["IMMUTABLE_SPOTS", "Disc", "Gaussian", "Image", "Rectangle", "Spot"]
