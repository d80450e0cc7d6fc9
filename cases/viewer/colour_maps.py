"""The colour maps that the viewer offers, that of the pictures first."""

import numpy as np

from tetlux.cases.picture.stage import color_table

# Every fifth colour of matplotlib's map "viridis" (CC0), as "inferno" of the pictures.
VIRIDIS = (
    "440154 46085c 471063 481769 481d6f 482475 472a7a 46307e 453781 433d84 414287 3f4889 3d4e8a 3a538b 38598c 355e8d "
    "33638d 31688e 2e6d8e 2c718e 2a768e 297b8e 27808e 25848e 23898e 218e8d 20928c 1f978b 1e9c89 1fa188 21a585 24aa83 "
    "28ae80 2eb37c 35b779 3dbc74 46c06f 50c46a 5ac864 65cb5e 70cf57 7cd250 89d548 95d840 a2da37 b0dd2f bddf26 cae11f "
    "d8e219 e5e419 f1e51d fde725"
)
GREY = "303030 f8f8f8"


def colour_maps() -> dict[str, list[str]]:
    """Colours of each map from its lower to its upper end, hexadecimal and evenly spaced."""
    bytes_of_pictures = np.round(255 * color_table()).astype(np.uint8)
    return {
        "inferno": [bytes(colour.tolist()).hex() for colour in bytes_of_pictures],
        "viridis": VIRIDIS.split(),
        "grey": GREY.split(),
    }
