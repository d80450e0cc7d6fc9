"""The picture of a run, rendered by PyVista or by the built-in rasterizer."""
