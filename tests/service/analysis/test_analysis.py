"""A recording of known contacts through `analyze`."""

from pathlib import Path

import numpy as np
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Localizer, Scene
from contactsense.service.analysis import Analysis, ForceLimits, LimitsError, analyze
from contactsense.service.analysis.contact_table import SCHEMA, write_contacts
from contactsense.service.recordings import read
from tests.service.analysis.recordings import demo, write_motion

SCENE = Scene(robot="ur5e")


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    path = write_motion(demo(), tmp_path_factory.mktemp("recordings") / "demo.parquet")
    return analyze(path, SCENE, estimates=True)


def test_every_contact_of_the_recording_is_found_where_it_was(analysis: Analysis) -> None:
    motion = demo()
    assert [contact.link for contact in analysis.contacts] == [touch.link for touch in motion.touches]
    for contact, touch in zip(analysis.contacts, motion.touches, strict=True):
        assert contact.begin == pytest.approx(touch.start, abs=0.2)
        assert contact.begin + contact.duration == pytest.approx(touch.stop, abs=0.3)
        assert np.linalg.norm(contact.point - touch.point_link) < 0.03
        force = np.linalg.norm(touch.force_base, axis=1)
        assert contact.peak_force == pytest.approx(force.max(), rel=0.15)
        assert contact.impulse == pytest.approx(np.trapezoid(force, dx=1 / motion.rate), rel=0.1)
        assert contact.complete
        moves = np.abs(motion.qd[touch.first]).max() > 0.0
        assert (contact.speed > 1e-3) == moves
        assert np.linalg.eigvalsh(contact.covariance).min() > -1e-15
        at = int(contact.peak_time * motion.rate)
        np.testing.assert_allclose(contact.q, motion.q[at], atol=0.01)


def test_a_contact_carries_the_rows_of_the_file_and_the_place_at_its_peak(analysis: Analysis) -> None:
    motion = demo()
    for contact, touch in zip(analysis.contacts, motion.touches, strict=True):
        assert motion.t[contact.row] == pytest.approx(contact.begin)
        at = round(contact.peak_time * motion.rate) - touch.first
        assert np.linalg.norm(contact.point_base - touch.point_base[at]) < 0.03
        assert repr(contact).startswith(f"<contact {contact.contact} at ")


def test_residuals_are_as_large_as_their_noise(analysis: Analysis) -> None:
    found = analysis.residuals
    assert found.free + found.touched <= analysis.samples
    assert np.all(found.base_ratio < 1.3)
    assert np.all(found.joint_ratio < 1.3)
    assert len(found.t) == len(found.energy) == len(found.joint_torque)
    assert found.missing[:2] == (0, 0)
    assert "free" in repr(found)


def test_estimates_of_every_sample_are_those_of_the_localizer(analysis: Analysis, tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "part.parquet", last=3000)
    table = analysis.estimates
    assert table is not None
    assert table.num_rows == analysis.samples
    links = table["link"].to_pylist()[:3000]
    estimates = list(Localizer(SCENE).run(read(path, SCENE).samples()))
    assert links == [estimate.contacts[0].link if estimate.contacts else None for estimate in estimates]


def test_the_table_is_written_as_parquet_and_csv(analysis: Analysis, tmp_path: Path) -> None:
    write_contacts(analysis.to_arrow(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["contacts.csv", "contacts.parquet"]
    table = pa_parquet.read_table(tmp_path / "contacts.parquet")
    assert table.schema == SCHEMA
    assert table.equals(analysis.to_arrow())
    text = pa_csv.read_csv(tmp_path / "contacts.csv")
    assert text.column_names == table.column_names
    assert text["link"].to_pylist() == table["link"].to_pylist()


def test_a_recording_that_ends_in_a_contact_tells_so(tmp_path: Path) -> None:
    touch = demo().touches[0]
    path = write_motion(demo(), tmp_path / "cut.csv", last=touch.first + 300)
    (contact,) = analyze(path, SCENE).contacts
    assert not contact.complete
    assert contact.link == touch.link


def test_forces_are_compared_with_the_users_own_limits(analysis: Analysis, tmp_path: Path) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(
        "provenance: our own risk assessment\n"
        "regions:\n"
        "  - {name: hand, quasi_static: 1000, transient: 22}\n"
        "  - {name: face, quasi_static: 22, transient: 1000}\n"
    )
    limits = ForceLimits.load(path)
    texts = [limits.exceeded(contact) for contact in analysis.contacts]
    for contact, found in zip(analysis.contacts, texts, strict=True):
        expected = int(contact.transient_force > 22) + int(contact.quasi_static_force > 22)
        assert len(found) == expected
    assert any("face" in found[-1] and "quasi-static" in found[-1] for found in texts if found)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("regions: []", "provenance: Field required"),
        ("[1]", "expected provenance and regions, got list"),
        ("provenance: x\nregions: [{name: hand, quasi_static: -1, transient: 2}]", "regions.0.quasi_static"),
        ("a: [", "not YAML"),
    ],
)
def test_wrong_limits_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(LimitsError, match=r"limits\.yaml") as caught:
        ForceLimits.load(path)
    assert message in str(caught.value)
