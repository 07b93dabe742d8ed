"""`contactsense analyze --scheduler`: a dataset on a Dask cluster."""

import gc
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from contactsense.scene import Scene
from contactsense.service.cli.analyze import analyze
from tests.service.analysis.datasets import carrying


def _run(data: Path, out: Path, *options: str) -> Result:
    return CliRunner().invoke(analyze, [str(data), "--out", str(out), *options])


@pytest.fixture
def data(tmp_path: Path) -> Path:
    carrying(tmp_path / "Zelle Süd", "a", Scene(robot="ur5e"))
    return tmp_path / "Zelle Süd"


@pytest.mark.slow
def test_a_dataset_is_analysed_on_the_cluster(tmp_path: Path, data: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, host="127.0.0.1", dashboard_address=None,
        scheduler_port=0, protocol="tcp",
    ) as cluster:  # fmt: skip
        result = _run(data, tmp_path / "there", "--scheduler", cluster.scheduler_address)
        assert cluster.scheduler.transition_counter > 0  # it was this cluster's work
    assert result.exit_code == 0, result.output
    assert _run(data, tmp_path / "here").exit_code == 0
    texts = [(tmp_path / out / "fleet.md").read_text(encoding="utf-8") for out in ("there", "here")]
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("address", "reason"),
    [("", "missing port"), ("localhost", "missing port"), ("foo://x:1", "unknown address scheme")],
)
def test_an_address_that_is_none_is_told(tmp_path: Path, data: Path, address: str, reason: str) -> None:
    distributed = pytest.importorskip("distributed")
    gc.disable()
    try:
        result = _run(data, tmp_path / "out", "--scheduler", address)
        # One that is collected while another starts blocks it for good.
        assert not [each for each in gc.get_objects() if type(each) is distributed.Client]
    finally:
        gc.enable()
    assert result.exit_code == 1
    assert f"--scheduler: {address!r}: " in result.output
    assert reason in result.output


def test_processes_of_both_kinds_are_refused(tmp_path: Path) -> None:
    result = _run(tmp_path, tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2")
    assert result.exit_code == 2
    assert "--workers and --scheduler: expected one of them, got both" in result.output
