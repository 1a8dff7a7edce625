"""The deformed surface of a body in space, drawn by pyvista without a window."""

from __future__ import annotations

import logging
import os
from types import ModuleType

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from contact.output.figures.body import with_scale
from contact.output.figures.contact import NARROW
from contact.output.figures.picture import Picture, widened

logger = logging.getLogger("contact.plots")


def draw_space(picture: Picture, title: str = "") -> Figure | None:
    """Draw the surface of a body in space, from above and from below, with pyvista."""
    try:
        import pyvista
    except ImportError:
        logger.warning("the deformed body is not drawn: pyvista is missing")
        return None
    if not _has_display(pyvista):
        logger.warning("the deformed body is not drawn: VTK before 9.4 needs a display or Xvfb")
        return None
    drawn = (picture.corners + picture.scale * picture.displacement).reshape(-1, 3)
    corners = np.arange(len(drawn)).reshape(-1, 3)
    faces = np.column_stack([np.full(len(corners), 3), corners])
    surface = pyvista.PolyData(drawn, faces.ravel())
    place = surface.cell_data if picture.values.ndim == 1 else surface.point_data
    place["values"] = picture.values.ravel()
    width = float(matplotlib.rcParams["figure.figsize"][0])
    shape, tall = ((2, 1), 1.6) if width < NARROW else ((1, 2), 0.52)
    figure = Figure(figsize=(width, tall * width))
    ends = float(picture.values.min()), float(picture.values.max())
    norm = Normalize(*(picture.limits or widened(*ends)))
    axes = figure.subplots(*shape)
    for ax, name, height in zip(axes, ("from above", "from below"), (0.8, -0.8), strict=True):
        plotter = pyvista.Plotter(off_screen=True, window_size=(1000, 900))
        plotter.set_background("white")
        plotter.add_mesh(
            surface,
            scalars="values",
            cmap="viridis",
            clim=[norm.vmin, norm.vmax],
            show_edges=len(faces) < 5000,
            line_width=0.5,
            ambient=0.5,
            diffuse=0.5,
            show_scalar_bar=False,
        )
        plotter.add_axes()
        plotter.view_vector((1.0, -1.6, height))
        plotter.reset_camera(bounds=picture.box.T.ravel())
        ax.imshow(plotter.screenshot(return_img=True))
        plotter.close()
        ax.set_title(name, fontsize="medium")
        ax.axis("off")
    colours = ScalarMappable(norm, "viridis")
    figure.colorbar(colours, ax=axes, location="bottom", label=picture.label, aspect=40, shrink=0.8)
    figure.suptitle(with_scale(title, picture.scale), fontsize="large")
    return figure


def _has_display(pyvista: ModuleType) -> bool:
    """Tell whether VTK can draw, with a virtual display where it takes one."""
    if os.environ.get("DISPLAY") or pyvista.vtk_version_info >= (9, 4):
        return True
    try:
        pyvista.start_xvfb()
    except OSError:
        return False
    return True
