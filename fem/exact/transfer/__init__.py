"""Radiative transfer by Monte Carlo: the random walk of photon packets, and batches of walks."""
