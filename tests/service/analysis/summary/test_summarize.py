"""The summary of a contact whose live estimates name several links."""

import numpy as np

from contactsense import SampleBlock, Scene
from contactsense.runtime.result_rows import COVARIANCE, FORCE, LINK, NORMAL, POINT, POINT_BASE, WIDTH
from contactsense.service.analysis.samples.contact_history import ContactHistory
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.tracking.contact_track import HOLD

SCENE = Scene(robot="ur5e")
Q = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5])
SHARP, BROAD = 1e-6, 1e-4


def _history(estimates: list[tuple[int, float, float]], probability: np.ndarray) -> ContactHistory:
    """An arm at rest; link, force and variance of the place of each sample's best candidate."""
    count, summarizer = len(estimates), Summarizer(SCENE)
    rows = np.zeros((count, WIDTH))
    for row, (link, force, variance) in zip(rows, estimates, strict=True):
        origin, rotation = summarizer.link_pose(Q, link)
        row[LINK], row[NORMAL], row[FORCE] = link, (1.0, 0.0, 0.0), (-force, 0.0, 0.0)
        row[POINT] = (0.01 * link, 0.02, 0.03)
        row[POINT_BASE] = origin + rotation @ row[POINT]
        row[COVARIANCE] = (variance * np.eye(3)).ravel()
    still = np.tile(Q, (count, 1))
    return ContactHistory(
        contact=1,
        row=np.arange(count),
        block=SampleBlock(0.002 * np.arange(count), still, np.zeros((count, 6))),
        phase=np.full(count, HOLD),
        energy=np.full(count, 100.0),
        usable=np.ones((count, 2), dtype=bool),
        base_wrench=np.zeros((count, 6)),
        base_wrench_std=np.ones((count, 6)),
        joint_torque=np.zeros((count, 6)),
        joint_torque_std=np.ones((count, 6)),
        sample=np.arange(count),
        rows=rows,
        link_probability=np.tile(probability, (count, 1)),
        complete=True,
    )


def test_the_place_is_on_the_link_that_is_named() -> None:
    """Link 4 is the most probable one of the whole contact, and that of no sample."""
    estimates = [(3, 20.0, BROAD), (5, 10.0, SHARP), (5, 10.0, SHARP)]
    history = _history(estimates, np.array([0.0, 0.0, 0.0, 0.3, 0.4, 0.3, 0.0]))
    found = Summarizer(SCENE).summarize(history, "")
    assert found.link_index == 3
    assert found.link == SCENE.link_names[3]
    np.testing.assert_allclose(found.point, history.rows[0, POINT])
    np.testing.assert_allclose(found.point_base, history.rows[0, POINT_BASE])


def test_of_the_places_on_the_most_probable_link_the_most_precise_one_is_named() -> None:
    estimates = [(3, 20.0, BROAD), (5, 10.0, SHARP), (3, 10.0, SHARP)]
    history = _history(estimates, np.array([0.0, 0.0, 0.0, 0.7, 0.0, 0.3, 0.0]))
    found = Summarizer(SCENE).summarize(history, "")
    assert found.link_index == 3
    np.testing.assert_allclose(np.diag(found.covariance), SHARP)
