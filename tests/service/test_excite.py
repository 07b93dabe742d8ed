"""`contactsense excite` as its users run it."""

import json
from pathlib import Path

import numpy as np
import pyarrow.csv as pa_csv
import pytest
from click.testing import CliRunner

from contactsense.service.cli.excite import excite


def test_a_motion_is_proposed_and_written(tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    asked = ["--robot", "ur10e", "--seconds", "8", "--tries", "4", "--into", str(path), "--rate", "50"]
    result = CliRunner().invoke(excite, [*asked, "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["seconds"] == 8.0
    assert said["lowest"] >= 0.05
    assert {p["name"]: p["std"] for p in said["parameters"]}["payload mass"] < 0.1
    table = pa_csv.read_csv(path).to_pydict()
    t = np.array(table["timestamp"])
    q, qd = (np.column_stack([table[f"{name}_{i}"] for i in range(6)]) for name in ("actual_q", "actual_qd"))
    assert len(t) == 401
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[1:-1], qd[1:-1], atol=0.02)
    np.testing.assert_allclose(np.abs(qd).max(axis=0), said["speed"], rtol=0.02)


def test_the_summary_names_every_parameter() -> None:
    result = CliRunner().invoke(excite, ["--robot", "ur5e", "--seconds", "8", "--tries", "2"])
    assert result.exit_code == 0, result.output
    for text in ("coulomb of elbow_joint", "payload mass", "condition number", "above the base plane"):
        assert text in result.output


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        ([], 2, "--robot and --scene: expected one of them"),
        (["--robot", "ur5e", "--home", "1,x"], 2, "--home: expected 6 angles"),
        (["--robot", "ur5e", "--home", "1,2"], 2, "--home: expected 6 angles in degrees"),
        (["--robot", "ur5e", "--speed", "2"], 2, "'--speed': 2.0 is not in the range 0.0<x<=1.0"),
        (["--robot", "ur5e", "--clearance", "-1"], 2, "'--clearance': -1.0 is not in the range 0.0<=x"),
        (["--robot", "ur5e", "--seed", "-1"], 2, "'--seed': -1 is not in the range x>=0"),
        (["--robot", "ur5e", "--floor", "nan"], 2, "'--floor': expected a finite number, got nan"),
        (["--robot", "ur5e", "--seconds", "nan"], 2, "'--seconds': expected a finite number, got nan"),
        (["--robot", "nobody"], 1, "nobody"),
        # Before the search, which takes long.
        (["--robot", "ur5e", "--into", "a.xyz"], 1, "a.xyz: expected a name that ends in .parquet or .csv"),
        (["--robot", "ur5e", "--into", "no/a.csv"], 1, "--into: no/a.csv: there is no folder no"),
        (["--scene", "absent.yaml"], 1, "absent.yaml: cannot read the scene"),
    ],
)
def test_what_is_wrong_is_said(arguments: list[str], status: int, message: str) -> None:
    result = CliRunner().invoke(excite, arguments)
    assert result.exit_code == status, result.output
    assert message in result.output
