"""`Power`: where the power of a light went."""

from dataclasses import dataclass

from tetlux.meshing.arrays import Number


@dataclass(frozen=True)
class Power:
    """The ledger of a run: ``incident = specular + absorbed + exited + ballistic + stored``, all in W.

    Real for steady light. For light modulated at one frequency these are complex amplitudes.

    Attributes
    ----------
    incident : float or complex
        Power that meets the body, or that sources inside it emit.
    specular : float or complex
        Reflected at the surface at once.
    absorbed : float or complex
        Turned to heat inside.
    exited : float or complex
        Left through the surface after having been scattered: the integral of the exitance.
    ballistic : float or complex
        Passed through without having been scattered.
    stored : float or complex
        Taken by the shift of the model, ``shift ∫ phi`` (see `tetlux.fem.models.model.Model`): 0 for steady light;
        for modulated light the amplitude of the rate at which the energy of the light in the body grows.
    """

    incident: Number
    specular: Number
    absorbed: Number
    exited: Number
    ballistic: Number
    stored: Number = 0.0

    @property
    def balance_error(self) -> Number:
        """Power missing from the ledger, as a share of the incident power."""
        out = self.specular + self.absorbed + self.exited + self.ballistic + self.stored
        return (self.incident - out) / self.incident


@dataclass(frozen=True)
class DyePower:
    """The ledger of a fluorophore: ``absorbed = lost + emitted + stored``, all in W.

    Attributes
    ----------
    absorbed : float or complex
        Power that the dye absorbs; part of `Power.absorbed` at the wavelength of excitation.
    lost : float or complex
        Turned to heat, for want of quantum yield.
    emitted : float or complex
        Power that the dye emits; part of `Power.incident` at the wavelength of emission.
    stored : float or complex
        Rate at which excited molecules store energy: 0 for steady light.
    """

    absorbed: Number
    lost: Number
    emitted: Number
    stored: Number = 0.0
