"""The equations that are solved: diffusion is the one model today."""
