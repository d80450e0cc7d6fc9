"""The example that goes from a spectrum to a saturation, with few wavelengths and fibres."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "docs" / "examples" / "saturation.py"


@pytest.mark.slow
def test_a_saturation_follows_from_a_spectrum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = importlib.util.spec_from_file_location("saturation", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    # From near by, so that it is soon there.
    monkeypatch.setattr(example, "START", {"hbo2": 50e-6, "hhb": 30e-6, "a": 1.3, "b": 1.2})
    picture = tmp_path / "picture.png"
    few = ["--wavelengths", "690", "830", "--fibres", "4", "--tolerance", "0.1", "--out", str(picture)]
    monkeypatch.setattr(sys, "argv", ["saturation.py", *few])
    example.main()
    found = re.search(r"StO2  (.*)% ± (.*)%  \(truth 65.00%\)", capsys.readouterr().out)
    assert found is not None
    value, error = map(float, found.groups())
    # Two wavelengths for four unknowns: within two and a half standard deviations, which are some per cent.
    assert 1.0 < error < 8.0
    assert value == pytest.approx(65.0, abs=2.5 * error)
    assert picture.stat().st_size > 20_000
