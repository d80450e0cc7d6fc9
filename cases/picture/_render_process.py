"""The program that renders with PyVista in a process of its own, since VTK without GL libraries crashes."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetlux.cases.picture.stage import see_through
from tetlux.meshing.mesher._mesher_process import die_with

if TYPE_CHECKING:
    from pyvista import PolyData


def main(job_path: str, image_path: str, parent: str) -> None:
    """Render the stage in ``job_path`` (npz) off-screen into ``image_path`` (npy, (h, w, 3) uint8).

    `parent` is the id of the process that waits for the image; if that ends, this one does too.
    """
    die_with(int(parent))
    import pyvista  # noqa: PLC0415

    with np.load(job_path) as data:
        job = {key: data[key] for key in data.files}
    width, height = job["size"].tolist()
    plotter = pyvista.Plotter(off_screen=True, window_size=[width, height], lighting="none")
    plotter.set_background(job["background"].tolist())
    center = job["center"]
    # A directional light: only the direction of its position counts.
    lamp = pyvista.Light(position=center + job["lamp"], focal_point=center, light_type="scene light")
    plotter.add_light(lamp)
    shaded, full = job["shading"].tolist()
    look = {"smooth_shading": True, "ambient": shaded, "diffuse": full - shaded, "specular": 0.0}
    body = _soup(job["corners"], job["normals"])
    if len(job["colours"]):
        body.point_data["colour"] = np.round(255 * job["colours"].reshape(-1, 3)).astype(np.uint8)
        plotter.add_mesh(body, scalars="colour", rgb=True, show_scalar_bar=False, **look)
    else:
        body.point_data["share"] = job["shares"].ravel()
        table = pyvista.LookupTable(values=np.round(255 * np.column_stack([job["table"], np.ones(256)])))
        table.scalar_range = (0.0, 1.0)
        plotter.add_mesh(body, scalars="share", cmap=table, interpolate_before_map=True, show_scalar_bar=False, **look)
    arrows = None
    if len(job["arrows"]):
        arrows = plotter.add_mesh(_soup(job["arrows"], job["arrow_normals"]), color=job["light"].tolist(), **look)
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = center.tolist()
    # In a parallel projection the distance matters for the clipping planes only.
    camera.position = (center + float(job["distance"]) * job["toward"]).tolist()
    camera.up = job["up"].tolist()
    camera.parallel_scale = float(job["half_height"])
    plotter.renderer.ResetCameraClippingRange()
    image = np.asarray(plotter.screenshot(return_img=True))
    if arrows is not None:
        arrows.SetVisibility(False)
        plotter.render()
        image = see_through(image, np.asarray(plotter.screenshot(return_img=True)), job["background"])
    plotter.close()
    np.save(Path(image_path), image)


def _soup(corners: np.ndarray, normals: np.ndarray) -> "PolyData":
    """Triangles (m, 3, 3) that share no vertices, with a normal at each corner."""
    import pyvista  # noqa: PLC0415

    order = np.arange(3 * len(corners)).reshape(-1, 3)
    mesh = pyvista.PolyData(corners.reshape(-1, 3), faces=np.insert(order, 0, 3, axis=1).ravel())
    mesh.point_data.active_normals = normals.reshape(-1, 3)
    return mesh


if __name__ == "__main__":
    main(*sys.argv[1:])
