"""The table of any robot: each row asks for what it says, and tells who fell."""

import importlib
import re
from pathlib import Path

import pytest

from gaitchain.gait.library_file import save_library

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

pytestmark = pytest.mark.slow


@pytest.fixture
def table(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("any_robot")


def test_rows_tell_speeds_errors_and_who_fell(
    table, toy_path, toy_library, tmp_path, monkeypatch, capsys
):
    """Of walks that are told as if they had been walked: a tenth slower, one falls."""
    save_library(toy_library, tmp_path / f"{toy_path.stem}.gait")
    asked = []

    def walked(verb, library, options, folder):
        assert Path(library).parent == folder
        assert verb == "trial"
        asked.append(options[-1])
        runs = int(options[options.index("--runs") + 1])
        schedule = options[-1] if "--schedule" in options else "0"
        speed = 0.9 * float(schedule.split(",")[0])
        return {
            "runs": runs,
            "survived": runs - ("--own-model" in options),
            "speed_mps": speed,
            "yaw_drift_deg": 1.25,
        }

    def pushed(library, folder):
        assert Path(library).parent == folder
        return {"worst_over_m_sqrt_gh": 0.25, "mean_over_m_sqrt_gh": 0.3}

    monkeypatch.setattr(table, "result", walked)
    monkeypatch.setattr(table, "pushes", pushed)
    monkeypatch.setattr(
        "sys.argv", ["any_robot.py", str(toy_path), "--out", str(tmp_path)]
    )
    table.main()
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["| | toy |", "|---|---|"]
    cells = [line.split(" | ")[-1].removesuffix(" |") for line in lines[2:]]
    fastest = toy_library.command_range.vx[1]
    assert cells[0].startswith(f"{toy_library.command_range.vx[0]:.3f} to ")
    assert cells[1] == f"{0.9 * int(1e4 * fastest) / 1e4:.3f}; 1.2"
    assert cells[4] == ", ".join(3 * ["10.0 / 1.2"])
    assert cells[5:7] == ["60/60", "59/60"]
    assert len(re.findall(r"\*\*3/4\*\*", cells[7])) == 3
    assert cells[8:] == ["20, 20, 20, 20", "0.250 / 0.300"]
    (ten_metres,) = [w for w in asked if w.endswith(f"@{_seconds(fastest)}")]
    assert ten_metres.startswith(f"{0.7 * int(1e4 * fastest) / 1e4:g},0,0")


def _seconds(fastest: float) -> str:
    """Return the time of 10 m at 0.7 of the speed, and half a second more."""
    return f"{10.0 / (0.7 * int(1e4 * fastest) / 1e4) + 0.5:.4g}"
