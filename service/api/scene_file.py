"""The scene that the settings name."""

from pathlib import Path

from pydantic import ValidationError

from contactsense.scene import Scene, SceneError, describe
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.scene.skin_meshes import check_meshes


def load_scene(settings: Settings) -> Scene:
    """Load the scene.

    Raises:
        SettingsError: The scene file cannot be used or has another robot, or there is no such robot.
    """
    try:
        if settings.scene is None:
            return Scene.model_validate({"robot": settings.robot})
        scene = Scene.load(settings.scene)
    except SceneError as error:
        raise SettingsError(str(error)) from None
    except ValidationError as error:
        raise SettingsError(describe(error, Scene)) from None
    except LookupError as error:
        raise SettingsError(str(error.args[0] if error.args else error)) from None
    try:
        check_meshes(scene)
    except SceneError as error:
        raise SettingsError(f"{settings.scene}: {error}") from None
    own = scene.robot
    same = own.name == settings.robot or (own.file or Path()).resolve() == Path(settings.robot).resolve()
    if "robot" in settings.model_fields_set and not same:
        raise SettingsError(
            f"--robot: expected {own.name}, the robot of {settings.scene}, or no --robot, "
            f"got {settings.robot!r}"
        )
    return scene
