"""Cells with a force/torque sensor within the arm, and the mistakes that people make with it."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from contactsense import LinkWrenchSensor, Scene, WrenchSensor
from contactsense.calibration import FreeMotion
from contactsense.robots.rotations import rpy_from_rotation
from contactsense.setup_check import Line

WRIST, ELBOW = "wrist_wrench", "link_wrenches.elbow"
"""Sensors within the arm."""
_ELBOW = 3
"""Number of the link that carries the second one: the forearm."""

Mistake = Callable[[Scene, FreeMotion, np.random.Generator], tuple[Scene, FreeMotion]]
"""From the true scene and its recording to a scene with a mistake, and the recording as it is read."""
LinkMistake = Callable[[str, Scene, FreeMotion, np.random.Generator], tuple[Scene, FreeMotion]]
"""The same for a mistake with one sensor within the arm; its field comes first."""


def with_sensor(scene: Scene, field: str, rng: np.random.Generator) -> Scene:
    """The cell with one sensor within the arm, of a range that is just large enough."""
    turn = float(rng.choice([0.0, 45.0, 90.0, 180.0])) + rng.normal(0.0, 2.0)
    place = float(rng.uniform(0.0, 0.04))
    stated: dict[str, object] = {
        "force_noise": 0.3,
        "moment_noise": 0.02,
        "rpy": (0.0, 0.0, float(np.radians(turn))),
        "translation": (0.0, 0.0, place),
        "sign": "arm_on_sensor" if rng.random() < 0.5 else "sensor_on_arm",
        "bias": (*rng.normal(0.0, 5.0, 3), *rng.normal(0.0, 0.5, 3)),
    }
    if field == WRIST:
        wrist = WrenchSensor.model_validate(stated | {"range": (100.0, 10.0)})
        return scene.model_copy(update={WRIST: wrist})
    own = LinkWrenchSensor.model_validate(
        stated | {"name": "elbow", "link": scene.robot.link_names[_ELBOW], "range": (400.0, 150.0)}
    )
    return scene.model_copy(update={"link_wrenches": (own,)})


def direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector of any direction."""
    vector = rng.standard_normal(3)
    return np.asarray(vector / np.linalg.norm(vector))


def _link(scene: Scene, field: str, **changes: object) -> Scene:
    sensor = scene.link_sensors[field].model_copy(update=changes)
    return scene.model_copy(update={WRIST: sensor} if field == WRIST else {"link_wrenches": (sensor,)})


def _link_sign(
    field: str, scene: Scene, recording: FreeMotion, _: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    other = {"arm_on_sensor": "sensor_on_arm", "sensor_on_arm": "arm_on_sensor"}
    return _link(scene, field, sign=other[scene.link_sensors[field].sign]), recording


def _link_turned(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    turn = Rotation.from_rotvec(np.pi / 2.0 * rng.choice([-1.0, 1.0]) * np.eye(3)[int(rng.integers(3))])
    rotation = Rotation.from_matrix(scene.link_sensors[field].rotation) * turn
    return _link(scene, field, rpy=rpy_from_rotation(rotation.as_matrix())), recording


def _link_moved(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    place = np.array(scene.link_sensors[field].translation) + rng.uniform(0.05, 0.15) * direction(rng)
    return _link(scene, field, translation=tuple(place.tolist())), recording


def _link_swapped(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    a, b = [(0, 1), (0, 2), (1, 2)][int(rng.integers(3))]
    order = np.arange(6)
    order[[a, b, a + 3, b + 3]] = order[[b, a, b + 3, a + 3]]
    return scene, _read_as(recording, field, recording.readings[field][:, order])


def _link_exchanged(
    field: str, scene: Scene, recording: FreeMotion, _: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    return scene, _read_as(recording, field, np.roll(recording.readings[field], 3, axis=1))


def _link_biased(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    off = np.concatenate((rng.uniform(1.0, 10.0) * direction(rng), rng.uniform(0.1, 1.0) * direction(rng)))
    bias = np.array(scene.link_sensors[field].bias) + off
    return _link(scene, field, bias=tuple(bias.tolist())), recording


def _link_late(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    return _link(scene, field, delay=float(rng.uniform(0.01, 0.05) * rng.choice([-1.0, 1.0]))), recording


def _link_small(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    """The sensor stays at its range, which this motion exceeds."""
    readings = recording.readings[field]
    limits = tuple(float(x) for x in rng.uniform(0.5, 0.9) * np.abs(readings).max(axis=0))
    clipped = np.clip(readings, np.negative(limits), limits)
    return _link(scene, field, range=limits), _read_as(recording, field, clipped)


def _on_another_link(
    field: str, scene: Scene, recording: FreeMotion, rng: np.random.Generator
) -> tuple[Scene, FreeMotion]:
    others = [i for i in range(1, len(scene.robot.links)) if i != _ELBOW]
    return _link(scene, field, link=scene.robot.link_names[int(rng.choice(others))]), recording


def _read_as(recording: FreeMotion, field: str, values: np.ndarray) -> FreeMotion:
    return recording.with_readings({**recording.readings, field: values})


def _mistakes_with(field: str) -> dict[str, tuple[Line, Mistake]]:
    last = field.rpartition(".")[2].removesuffix("_wrench")
    kinds: dict[str, tuple[Line, LinkMistake]] = {
        f"sign of the {last} wrench": (f"{field}.sign", _link_sign),
        f"{last} sensor turned by 90 degrees": (f"{field}.rpy", _link_turned),
        f"{last} sensor displaced by 5 to 15 cm": (f"{field}.translation", _link_moved),
        f"two axes of the {last} sensor exchanged": (f"{last} wrench: order of axes", _link_swapped),
        f"force and moment of the {last} sensor exchanged": (
            f"{last} wrench: force and moment",
            _link_exchanged,
        ),
        f"{last} sensor 10 to 50 ms late or early": (f"{field}.delay", _link_late),
        f"bias of the {last} sensor": (f"{field}.bias", _link_biased),
        f"{last} sensor of a range too small": (f"{field}.range", _link_small),
    }
    if field != WRIST:
        kinds[f"{last} sensor on another link"] = (f"{field}.link", _on_another_link)
    return {kind: (line, partial(mistake, field)) for kind, (line, mistake) in kinds.items()}


LINK_MISTAKES = {field: _mistakes_with(field) for field in (WRIST, ELBOW)}
"""The same for cells with a sensor within the arm, by its field."""
