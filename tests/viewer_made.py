"""A run with a viewer that several tests share: three channels, two lights, a region, detectors, a volume."""

import base64
import gzip
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.load import load_cases
from tetlux.cases.run import run_case

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Of Chromium: without a screen, drawn in software.
OPTIONS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]

CASE = """\
name: block
surface: {box: {size: [8, 8, 8], center: [100, 0, 0]}}
medium: {sigma_a: [0.01, 0.03], sigma_s_prime: [1.0, 1.2], eta: 1.4}
channels: [near, far]
regions:
  - name: ball
    surface: {sphere: {radius: 2, center: [100, 0, 0]}}
    medium: {sigma_a: 0.2, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - name: beam
    pencil: {origin: [101, 0, 9], direction: [0, 0, -1], power: [2, 1]}
  - {name: lamp, point: {position: [99, -1, -2], power: 0.5}}
detectors:
  - {name: top, point: [102, 0, 4]}
  - {name: side, point: [104, 0, 0]}
tolerance: 0.3
outputs: [surface, volume, viewer]
"""


def run_with_viewer(folder: Path, case: str = CASE, name: str = "case") -> Path:
    """Run a case, and return the folder of its results."""
    (folder / f"{name}.yaml").write_text(case)
    (loaded,) = load_cases(folder / f"{name}.yaml")
    return run_case(loaded, folder / "out")


def data_of(page: Path) -> dict[str, Any]:
    """The data in a page."""
    text = page.read_text(encoding="utf-8").partition('<script type="application/json" id="data">')[2]
    data: dict[str, Any] = json.loads(text.partition("</script>")[0])
    return data


def unpack(packed: dict[str, Any]) -> Any:
    """Unpack an array as the script of the viewer does."""
    kind = np.dtype(packed["type"]).newbyteorder("<")
    planes = np.frombuffer(gzip.decompress(base64.b64decode(packed["data"])), np.uint8).reshape(kind.itemsize, -1)
    numbers = np.ascontiguousarray(planes.T).view(kind).reshape(packed["shape"])
    if packed.get("differences"):
        return np.cumsum(numbers, axis=0, dtype=np.uint32)
    return numbers.astype(np.float64) * packed["factor"] if "factor" in packed else numbers
