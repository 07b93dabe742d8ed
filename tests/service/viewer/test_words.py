"""Estimates in words, and controls as lines of a scene."""

from dataclasses import replace

import numpy as np
import yaml

from contactsense.scene import Scene
from contactsense.service.viewer.view_panel import scene_lines
from contactsense.service.viewer.words import in_words
from tests.service.viewer.estimates import POSTURE, contact, estimate

SCENE = Scene(robot="ur5e")
POINT = np.array([-0.2, 0.05, 0.0])


def test_without_contact_they_tell_what_would_be_detected() -> None:
    assert (
        in_words(estimate(SCENE))
        == "**No contact detected.**\n\nA held push of 3.2 N would be detected anywhere."
    )


def test_blind_is_not_nothing() -> None:
    blind = replace(estimate(SCENE), status="degraded", reason="no sensor has a value in this sample")
    assert in_words(blind).startswith(
        "**Degraded.** **No contact detected, but one may be missed.**\n\nno sensor has a value"
    )


def test_a_reason_that_the_service_tells_is_not_repeated() -> None:
    """A small screen has no room for both."""
    doubted = replace(estimate(SCENE), reason="a line of the scene is wrong")
    note = "degraded: base_wrench: 9% are lost; a line of the scene is wrong"
    assert "a line of the scene is wrong" in in_words(doubted, "ok")
    assert in_words(doubted, note) == in_words(estimate(SCENE))


def test_the_place_is_within_the_ninety_percent_radius() -> None:
    # 90 % of a two-dimensional Gaussian lie within 2.146 standard deviations.
    words = in_words(estimate(SCENE, contact(SCENE, POSTURE, 3, POINT, deviation=0.01)))
    assert "| forearm | 20.0 N | 21 mm | > 99 % |" in words
    sharp = in_words(estimate(SCENE, contact(SCENE, POSTURE, 3, POINT, deviation=0.0002)))
    assert "| forearm | 20.0 N | 0.4 mm | > 99 % |" in sharp


def test_an_unbounded_place_is_unknown() -> None:
    words = in_words(estimate(SCENE, contact(SCENE, POSTURE, 3, POINT, deviation=np.inf)))
    assert "| forearm | 20.0 N | unknown | > 99 % |" in words


def test_all_explanations_and_none_of_them_add_up() -> None:
    both = [contact(SCENE, POSTURE, link, POINT, probability=p) for link, p in ((3, 0.6), (2, 0.3))]
    words = in_words(estimate(SCENE, *both, status="ambiguous"))
    shares = [float(line.split("|")[4].strip(" %")) for line in words.splitlines()[4:]]
    assert shares == [60.0, 30.0, 10.0]


def test_a_single_explanation_is_not_compared_with_others() -> None:
    """As where a contact of an analysis has its most probable explanation alone."""
    only = contact(SCENE, POSTURE, 3, POINT, probability=0.6)
    words = in_words(estimate(SCENE, only, status="ambiguous"))
    assert words.startswith("**Ambiguous:** one explanation, which is not certain.")


def test_nothing_is_listed_with_zero_percent() -> None:
    nearly = [contact(SCENE, POSTURE, link, POINT, probability=p) for link, p in ((3, 0.6), (2, 0.397))]
    assert "none of these" not in in_words(estimate(SCENE, *nearly, status="ambiguous"))


def test_lines_of_the_scene_make_the_scene_that_is_drawn() -> None:
    rpy, translation = np.array([0.0, 0.1, 1.0]), np.array([0.0, 0.01, -0.02])
    text = scene_lines(np.array([np.pi / 2, 0.0, 0.25]), rpy, translation, sensor=True)
    scene = Scene(robot="ur5e", **yaml.safe_load(text.split("```yaml\n")[1].split("```")[0]))
    np.testing.assert_allclose(scene.mounting, [np.pi / 2, 0.0, 0.25], atol=1e-3)
    assert scene.base_wrench is not None
    np.testing.assert_allclose(scene.base_wrench.rpy, rpy)
    np.testing.assert_allclose(scene.base_wrench.translation, translation)
