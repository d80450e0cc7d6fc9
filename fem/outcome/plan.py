"""`Plan`: by which models a scene could be solved, what each would cost, and which was chosen."""

import math
from dataclasses import dataclass, replace
from typing import Literal

from tetlux.meshing.describe import percent
from tetlux.meshing.html import html_table

Model = Literal["closed-form", "charges", "truncated", "full"]

# What a candidate is called in a plan is padded to this width.
WIDTH = 11


@dataclass(frozen=True)
class Candidate:
    """One way to solve a scene.

    Attributes
    ----------
    model : {"closed-form", "charges", "truncated", "full"}
    error : float
        Predicted relative L2 error of the exitance; nan if it is not a way to solve this scene.
    seconds : float
        Predicted seconds; nan if it is not a way.
    bytes : float
        Predicted memory, in addition to that of the program; nan if it is not a way.
    reason : str
        What it does, or why it is not a way.
    suits : bool
        Whether it can give what is asked for, within the tolerance.
    kind : str
        Kind of scene: past runs of the same kind refine predictions.
    learned : tuple of (float, float)
        Factors of past runs, see `tetlux.fem.planner.costs`, on the seconds and the error, which contain them.
    """

    model: Model
    error: float
    seconds: float
    bytes: float
    reason: str
    suits: bool
    kind: str = ""
    learned: tuple[float, float] = (1.0, 1.0)

    def __str__(self) -> str:
        name = f"{self.model:{WIDTH}}  "
        if math.isnan(self.seconds):
            return f"{name}no: {self.reason}"
        figures = f"{seconds_in_words(self.seconds)}, {_megabytes(self.bytes)}, error {percent(self.error)}"
        return f"{name}{figures if self.suits else f'no: {figures}'}: {self.reason}"


@dataclass(frozen=True)
class Plan:
    """How a scene is solved, and why.

    Attributes
    ----------
    chosen : {"closed-form", "charges", "truncated", "full"}
    candidates : tuple of Candidate
        The simplest first.
    tolerance : float or None
        Wanted relative L2 error of the exitance.
    near_error : float
        Expected relative error of diffusion itself, which none of the models reduces, at one mean free path from thin
        beams and points; see `tetlux.fem.validity.beforehand`.
    model_error : float
        The same elsewhere.
    runs : int
        Number of runs that share the plan.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointSource, plan
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> plan(sphere(10.0), tissue, [PointSource((0, 0, 5))], tolerance=0.02).chosen
    'closed-form'
    """

    chosen: Model
    candidates: tuple[Candidate, ...]
    tolerance: float | None
    near_error: float
    model_error: float
    runs: int = 1

    @property
    def best(self) -> Candidate:
        """The chosen candidate."""
        return self[self.chosen]

    def __getitem__(self, model: str) -> Candidate:
        return next(each for each in self.candidates if each.model == model)

    def without(self, model: Model, reason: str) -> "Plan":
        """The plan after a model was tried in vain: the cheapest of the others is chosen."""
        candidates = tuple(
            replace(each, reason=reason, suits=False) if each.model == model else each for each in self.candidates
        )
        return replace(self, candidates=candidates, chosen=cheapest(candidates))

    def __str__(self) -> str:
        wanted = "" if self.tolerance is None else f" for a tolerance of {self.tolerance:g}"
        shared = "" if self.runs == 1 else f", for each of {self.runs:,} runs"
        lines = [f"plan: {self.chosen}{wanted}{shared}", *(f"  {each}" for each in self.candidates)]
        if max(self.near_error, self.model_error) > (self.tolerance or 0.0):
            near = f"about {percent(self.near_error)} a mean free path from the light, " if self.near_error else ""
            lines.append(
                f"  diffusion itself is off by {near}{percent(self.model_error)} elsewhere, whatever the model"
            )
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        title, *lines = str(self).splitlines()
        # Those of candidates begin with the name of the model.
        first = len(self.candidates)
        rows = [(each.model, str(each).partition("  ")[2].strip()) for each in self.candidates]
        return html_table(title, [*rows, *(("note", line.strip()) for line in lines[first:])])


def cheapest(candidates: tuple[Candidate, ...]) -> Model:
    """The model of the cheapest candidate that suits; the last, if none does."""
    suitable = [each for each in candidates if each.suits] or [candidates[-1]]
    return min(suitable, key=lambda each: each.seconds).model


def seconds_in_words(seconds: float) -> str:
    """Seconds with two digits, such as ``1.2 s``."""
    return f"{max(seconds, 1e-3):.2g} s" if seconds < 100 else f"{seconds:.0f} s"


def _megabytes(count: float) -> str:
    return f"{max(count / 1e6, 1.0):.0f} MB"
