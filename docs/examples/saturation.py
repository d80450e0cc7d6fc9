"""From a spectrum to a saturation: what ten fibres read at six wavelengths, and the haemoglobin that follows.

python docs/examples/saturation.py --out docs/pictures/saturation.png
"""

import argparse

import numpy as np
from matplotlib.figure import Figure

from tetlux.fem import FibreDetector, PencilBeam, fit, solve, tissue
from tetlux.meshing import cylinder

# 1. The truth: an arm of tissue with 65 % of its haemoglobin oxygenated, in a beam of light.
TRUTH = {"hbo2": 52e-6, "hhb": 28e-6, "a": 1.3, "b": 1.2}
KNOWN = {"water": 0.65, "fat": 0.1, "eta": 1.4}
START = {"hbo2": 30e-6, "hhb": 30e-6, "a": 1.0, "b": 1.0}
NOISE = 0.01
RADIUS = 20.0


def main() -> None:
    """Make readings with noise, fit them, print what was found, and draw it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", default="saturation.png")
    parser.add_argument("--wavelengths", type=float, nargs="+", default=[690.0, 730.0, 760.0, 800.0, 830.0, 850.0])
    parser.add_argument("--fibres", type=int, default=10)
    parser.add_argument("--tolerance", type=float, default=0.005)
    options = parser.parse_args()

    # 2. Fibres along and around the arm, 5 to 25 mm from the beam.
    arm, beam = cylinder(radius=RADIUS, height=120.0), PencilBeam(origin=(30, 0, 0), direction=(-1, 0, 0))
    steps = np.linspace(5.0, 25.0, options.fibres)
    around = np.where(np.arange(options.fibres) % 2, 0.5, 0.0) * steps / RADIUS
    along = np.sqrt(steps**2 - (around * RADIUS) ** 2)
    fibres = [
        FibreDetector((RADIUS * np.cos(a), RADIUS * np.sin(a), z), radius=0.4, numerical_aperture=0.4)
        for a, z in zip(around.tolist(), along.tolist(), strict=True)
    ]

    # 3. What they read: here by another method (charges, without a mesh) and noise; yours come from a spectrometer.
    wanted = {"model": "charges", "tolerance": None, "detectors": fibres, "detector_tolerance": 0.002}
    media = tissue(wavelengths=options.wavelengths, **TRUTH, **KNOWN)
    solved = [solve(arm, medium, [beam], **wanted) for medium in media]
    exact = np.array([[reading.exitance for reading in solution.readings] for solution in solved])
    measured = exact * (1.0 + NOISE * np.random.default_rng(5).standard_normal(exact.shape))

    # 4. The fit: haemoglobin and scattering; water and fat are taken as known.
    start = {"wavelengths": options.wavelengths, **START, **KNOWN}
    found = fit(
        arm, [beam], fibres, measured[:, None], list(TRUTH), start, noise=NOISE, detector_tolerance=options.tolerance
    )

    # 5. Saturation and its error, by the covariance of both haemoglobins.
    hbo2, hhb = found.values["hbo2"], found.values["hhb"]
    slope = np.array([hhb, -hbo2]) / (hbo2 + hhb) ** 2
    saturation, error = hbo2 / (hbo2 + hhb), float(np.sqrt(slope @ found.covariance[:2, :2] @ slope))
    for name, value in found.values.items():
        print(f"{name:<5} {value:.4g} ± {found.errors[name]:.2g}  (truth {TRUTH[name]:g})")
    print(f"StO2  {saturation:.2%} ± {error:.2%}  (truth {TRUTH['hbo2'] / (TRUTH['hbo2'] + TRUTH['hhb']):.2%})")
    print(f"differences are {found.misfit:.2f} times the noise; {found.evaluations} evaluations")
    for sentence in found.undetermined:
        print(sentence)
    draw(options, steps, measured, found, (saturation, error))


def draw(options, steps, measured, found, saturation):
    """Draw readings with the fit, absorption with the truth, and the values with their errors."""
    figure = Figure(figsize=(13.0, 4.6), dpi=110)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.2, 1.2, 1.0))
    for number, (wavelength, row, fitted) in enumerate(
        zip(options.wavelengths, measured, found.readings[:, 0], strict=True)
    ):
        color = f"C{number}"
        left.errorbar(steps, row, yerr=NOISE * row, fmt="o", color=color, markersize=4, label=f"{wavelength:g} nm")
        left.plot(steps, fitted, color=color, linewidth=1)
    left.set(yscale="log", xlabel="distance from the beam, mm", ylabel="exitance, W/mm²", title="readings and fit")
    left.legend(frameon=False, fontsize=8)

    fine = np.linspace(min(options.wavelengths), max(options.wavelengths), 80)
    true, fitted = (
        [medium.sigma_a for medium in tissue(wavelengths=fine, **values, **KNOWN)] for values in (TRUTH, found.values)
    )
    middle.plot(fine, true, "--", color="0.4", label="truth")
    middle.plot(fine, fitted, color="C3", label="fit")
    middle.plot(options.wavelengths, [media[0].sigma_a for media in found.media], "o", color="C3", markersize=4)
    middle.set(xlabel="wavelength, nm", ylabel="absorption, 1/mm", title="absorption", ylim=(0, None))
    middle.legend(frameon=False)

    total = TRUTH["hbo2"] + TRUTH["hhb"]
    values = [1e6 * found.values["hbo2"], 1e6 * found.values["hhb"], 100.0 * saturation[0]]
    errors = [1e6 * found.errors["hbo2"], 1e6 * found.errors["hhb"], 100.0 * saturation[1]]
    truth = [1e6 * TRUTH["hbo2"], 1e6 * TRUTH["hhb"], 100.0 * TRUTH["hbo2"] / total]
    right.errorbar(range(3), values, yerr=errors, fmt="o", color="C3", capsize=6, label="fit")
    right.plot(range(3), truth, "_", color="0.4", markersize=30, label="truth")
    right.set_xticks(range(3), ["HbO2, µmol/l", "HHb, µmol/l", "StO2, %"])
    right.set(xlim=(-0.5, 2.5), ylim=(0, 1.3 * max(truth)), title="haemoglobin")
    right.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(options.out)


if __name__ == "__main__":
    main()
