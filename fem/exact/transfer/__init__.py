"""Radiative transfer by Monte Carlo: the walk of a photon packet, and batches of walks."""
