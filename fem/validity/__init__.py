"""Where the diffusion approximation itself is off, with figures."""
