"""The sections of the case file that describe the cross-section of a beam."""

from pydantic import Field

from tetlux.cases.file.schema.light_context import LightContext
from tetlux.cases.file.schema.parts import Choice, Encoding, Length, Section, Vector3
from tetlux.fem.lights import Disc, Gaussian, Image, Rectangle

AnySpot = Disc | Gaussian | Rectangle | Image


class DiscSpec(Section):
    """A round spot, or a round patch of the surface."""

    center: Vector3
    radius: Length


class RectangleSpec(Section):
    """A uniform rectangular spot."""

    center: Vector3
    width: Length
    height: Length
    up: Vector3 = Field((0.0, 1.0, 0.0), description="the direction that is up on it, not along the beam")


class ImageSpec(Section):
    """A spot with the pattern of an image."""

    file: str = Field(description="image file, relative to the case file")
    center: Vector3
    width: Length
    up: Vector3 = Field((0.0, 1.0, 0.0), description="the direction that is up on it, not along the beam")
    encoding: Encoding = "srgb"


class SpotSpec(Choice):
    """The cross-section of a beam."""

    disc: DiscSpec | None = None
    gaussian: DiscSpec | None = Field(None, description="exp(-2 r²/radius²)")
    rectangle: RectangleSpec | None = None
    image: ImageSpec | None = None

    def spot(self, context: LightContext) -> AnySpot | None:
        """Build the spot of one channel, or return None where its image is dark."""
        if self.disc:
            return Disc(self.disc.center, self.disc.radius)
        if self.gaussian:
            return Gaussian(self.gaussian.center, self.gaussian.radius)
        if self.rectangle:
            return Rectangle(**dict(self.rectangle))
        assert self.image is not None
        # `Image` itself refuses an image that is black in all channels.
        pixels = context.pixels(self.image.file, self.image.encoding)
        return None if pixels is None else Image(self.image.center, self.image.width, pixels, self.image.up)
