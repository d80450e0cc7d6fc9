"""Fluorescence: dyes that are lit at one wavelength and emit at another, both solved for on one mesh."""
