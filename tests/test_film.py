"""``tetlux film``: runs one after the other."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from tetlux.cases.cli import main

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{point: {position: [0, 0, 3], power: 1.0}}]
model: closed-form
outputs: [surface]
sweep: {lights.0.point.power: [10.0, 1.0, 100.0]}
"""


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("film")
    (folder / "ball.yaml").write_text(CASE)
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder), "--quiet", "--jobs", "1"]) == 0
    return folder / "ball"


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_a_sweep_is_shown_by_rising_values_on_one_scale(
    suffix: str, sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film = tmp_path / f"film{suffix}"
    assert main(["film", str(sweep), "--out", str(film)]) == 0
    assert capsys.readouterr().out == f"3 runs, written to {film}\n"
    with Image.open(film) as opened:
        frames = [np.asarray(frame.convert("RGB"), dtype=float) for frame in ImageSequence.Iterator(opened)]
    assert len(frames) == 3
    middles = [frame[400:430, 340:370].mean() for frame in frames]
    # A tenfold power is brighter, and the colour bar stays.
    assert middles[0] + 20 < middles[1] < middles[2] - 20
    for frame in frames[1:]:
        # A GIF has colours of its own in each picture: measured 2.6.
        assert np.abs(frame[200:640, 720:750] - frames[0][200:640, 720:750]).mean() < 8


def test_runs_are_shown_in_the_order_given(sweep: Path, tmp_path: Path) -> None:
    bright, middling, dark = (str(sweep / f"lights.0.point.power={power}") for power in ("100.0", "10.0", "1.0"))
    main(["film", bright, dark, middling, "--out", str(tmp_path / "film.gif")])
    with Image.open(tmp_path / "film.gif") as opened:
        frames = [np.asarray(frame.convert("RGB"), dtype=float) for frame in ImageSequence.Iterator(opened)]
    middles = [frame[400:430, 340:370].mean() for frame in frames]
    assert middles[1] < middles[2] < middles[0]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--out", "film.mp4"], "film.mp4 is neither .gif nor .webp; give --out one of these endings."),
        (["--field", "glow"], 'has no field "glow"; its fields are exitance'),
    ],
)
def test_what_cannot_be_shown_is_refused(
    arguments: list[str],
    sentence: str,
    sweep: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(sweep)
    assert main(["film", ".", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_a_folder_without_runs_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["film", str(tmp_path)]) == 2
    assert "holds no finished run; give the folder of a run, or that of a sweep." in capsys.readouterr().err
