"""Cross-sections of beams, one a file."""

from tetlux.fem.lights.spots.disc import Disc
from tetlux.fem.lights.spots.gaussian import Gaussian
from tetlux.fem.lights.spots.image import Image
from tetlux.fem.lights.spots.rectangle import Rectangle
from tetlux.fem.lights.spots.spot import Spot

# Spots that stay what they are, so that what they light may be remembered.
UNCHANGING = (Disc, Gaussian, Rectangle, Image)

__all__ = ["UNCHANGING", "Disc", "Gaussian", "Image", "Rectangle", "Spot"]
