"""The viewer in headless Chromium, drawn in software: ``python -m tests.benchmarks.viewer [PAGE...]``.

For each page its triangles and size, the seconds from opening it to its first frame, and frames per second while the
mouse turns it, in windows of a desktop and of a phone. Frames are counted when the canvas has been drawn and read, so
that none waits in a queue. Without pages, the hare that ships and one of 100,000 triangles made of it, both with
volume.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fast_simplification
import trimesh

from tests.benchmarks.surfaces import refined
from tests.viewer_made import CHROMIUM, OPTIONS
from tetlux.cases.file.load import load_cases
from tetlux.cases.run import run_case
from tetlux.cases.shipped import library_folder
from tetlux.meshing import Surface, read_surface

SIZES = {"desktop": (1280, 900), "phone": (390, 844)}
TRIANGLES = 100_000
SECONDS = 4.0
# Turns by the mouse, as a hand does: an event for each frame of the screen, each one drawn.
TURN = """async (seconds) => {
  const canvas = document.getElementById("view");
  const send = (kind, x) => canvas.dispatchEvent(new PointerEvent(kind, {
    pointerId: 1, pointerType: "mouse", isPrimary: true, button: 0, buttons: 1, clientX: x, clientY: 300, bubbles: true,
  }));
  canvas.setPointerCapture = canvas.releasePointerCapture = () => {};
  const frame = () => new Promise(requestAnimationFrame);
  const gl = tetlux.renderer.getContext();
  send("pointerdown", 200);
  const [started, before] = [performance.now(), tetlux.frames];
  for (let x = 203; performance.now() - started < 1000 * seconds; x += 3) {
    send("pointermove", x);
    await frame();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
  const rate = (tetlux.frames - before) / (performance.now() - started) * 1000;
  send("pointerup", 0);
  return rate;
}"""


def measure(browser: Any, path: Path, size: tuple[int, int]) -> tuple[int, float, float]:
    """Triangles, seconds to the first frame, and frames per second."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    started = time.perf_counter()
    page.goto(path.resolve().as_uri())
    page.wait_for_selector("html[data-ready]")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    first = time.perf_counter() - started
    triangles = int(page.evaluate("tetlux.triangles.length / 3"))
    rate = float(page.evaluate(TURN, SECONDS))
    page.close()
    return triangles, first, rate


def make_pages(folder: Path) -> Iterator[Path]:
    """Run the hare as it ships, and with many triangles."""
    hare = read_surface(library_folder() / "hare.stl")
    finer = refined(hare, TRIANGLES)
    points, faces = fast_simplification.simplify(finer.points, finer.faces, target_count=TRIANGLES)
    text = (library_folder() / "hare.yaml").read_text()
    for name, surface in (("hare", hare), ("fine", Surface(points, faces, hare.unit, "fine"))):
        trimesh.Trimesh(surface.points, surface.faces, process=False).export(folder / f"{name}.stl")
        changed = text.replace("name: hare", f"name: {name}").replace("hare.stl", f"{name}.stl")
        (folder / f"{name}.yaml").write_text(f"{changed}outputs: [surface, volume, viewer]\n")
        (case,) = load_cases(folder / f"{name}.yaml")
        yield run_case(case, folder / "out") / "viewer.html"


def main() -> None:
    """Print a row for each page and window."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415

    assert CHROMIUM is not None, "there is no Chromium on the path"
    print("| page | triangles | MB | window | first frame, s | frames/s |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        for path in [Path(argument) for argument in sys.argv[1:]] or make_pages(Path(temporary)):
            for name, size in SIZES.items():
                triangles, first, rate = measure(browser, path, size)
                megabytes = path.stat().st_size / 1e6
                row = f"{path.parent.name} | {triangles:,} | {megabytes:.2f} | {name} | {first:.2f} | {rate:.1f}"
                print(f"| {row} |", flush=True)
        browser.close()


if __name__ == "__main__":
    main()
