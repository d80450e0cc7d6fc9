"""Expected errors of the diffusion approximation itself, and the warnings about them."""
