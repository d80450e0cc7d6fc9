"""`check_pictures`: whether the pictures that a case asks for can be drawn."""

from collections.abc import Sequence

import numpy as np

from tetlux.cases.file.documents.document import Document
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.pictures import CutSpec, PictureSpec, file_names
from tetlux.cases.hints import did_you_mean
from tetlux.cases.picture.view import toward_camera
from tetlux.fem.inputs import unit_vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# Models that always have a mesh.
WITH_MESH = ("full", "truncated")


def check_pictures(
    document: Document, spec: CaseSpec, surface: Surface, channels: Sequence[str], lights: Sequence[str]
) -> None:
    """Refuse pictures of what the run does not have, or from where nothing is seen.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if spec.picture is None:
        return
    if "picture" not in spec.outputs:
        raise document.error(("picture",), "outputs has no picture; add it there, or leave this out.")
    names = file_names(spec.pictures)
    for number, picture in enumerate(spec.pictures):
        key = ("picture", number) if isinstance(spec.picture, list) else ("picture",)
        if names[number] in names[:number]:
            raise document.error(key, f"two pictures would be {names[number]}; give one of them another name.")
        with document.at(key):
            _check_parts(picture, channels, lights)
            _check_field(picture, spec, channels)
            if picture.cut is not None:
                _check_cut(picture.cut, surface)
        if picture.camera is not None:
            with document.at((*key, "camera")):
                toward_camera(picture.camera, surface, spec.up)


def _check_parts(picture: PictureSpec, channels: Sequence[str], lights: Sequence[str]) -> None:
    for kind, name, known in (("channel", picture.channel, channels), ("light", picture.light, lights)):
        if name is not None and name not in known:
            hint = did_you_mean(name, known)
            raise InputError(f'there is no {kind} "{name}"; {hint}the {kind}s are {", ".join(known)}.')


def _check_field(picture: PictureSpec, spec: CaseSpec, channels: Sequence[str]) -> None:
    field = "fluence" if picture.shows_fluence else picture.field
    if field in ("fluence", "valid") and spec.model not in WITH_MESH:
        raise InputError(f'the field {field} needs a mesh, which model "{spec.model}" may lack; write model: full.')
    if field == "fluence" and len(channels) > 1 and picture.channel is None:
        raise InputError(f"the fluence is that of one channel; add channel, one of {', '.join(channels)}.")
    if field == "phase" and spec.modulation is None:
        raise InputError("the field phase is that of modulated light; add modulation to the case.")
    if field == "radiance" and (spec.camera is None or spec.camera.position is None):
        raise InputError("the field radiance needs camera: {position: ...} in the case, not in the picture.")
    if field == "colours" and tuple(channels) != ("red", "green", "blue"):
        raise InputError("colours are those of channels red, green and blue; write field: exitance.")


def _check_cut(cut: CutSpec, surface: Surface) -> None:
    normal = unit_vector(cut.normal, "normal")
    if cut.through is not None and ((surface.points - np.array(cut.through)) @ normal >= 0).all():
        raise InputError("the cut takes all of the body away; move it through the body, or reverse its normal.")
