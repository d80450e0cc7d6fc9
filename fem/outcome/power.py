"""`Power`: where the power of a light went."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Power:
    """The ledger of a run: ``incident = specular + absorbed + exited + ballistic``, all in W.

    Attributes
    ----------
    incident : float
        Power that meets the body, or that sources inside it emit.
    specular : float
        Reflected at the surface at once.
    absorbed : float
        Turned to heat inside.
    exited : float
        Left through the surface after having been scattered: the integral of the exitance.
    ballistic : float
        Passed through without having been scattered.
    """

    incident: float
    specular: float
    absorbed: float
    exited: float
    ballistic: float

    @property
    def balance_error(self) -> float:
        """What the ledger lacks, as a share of the incident power."""
        out = self.specular + self.absorbed + self.exited + self.ballistic
        return (self.incident - out) / self.incident
