"""Where the samples come from by the settings: the robot, a controller that pushes them, or nowhere."""

from collections.abc import Callable
from functools import partial

from contactsense.scene import Scene
from contactsense.service.api.settings import OptionsError, Settings, SettingsError
from contactsense.service.api.variables import PREFIX
from contactsense.service.controllers.push_source import PushSource
from contactsense.service.reactions.rules import ReactionRules
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.source_settings import SourceSettings
from contactsense.service.wire.rtde_fields import JOINTS

READERS = (
    "ft_host", "ft_fields", "ft_port", "ft_http_port", "ft_counts", "ft_rate", "robot_port",
    "robot_client", "wrist_fields", "link_wrenches", "constant_readings",
)  # fmt: skip
"""Settings of how the robot and its sensors are read: without effect where the service reads no robot."""
_REACTIONS_TOO = ("robot_host", "robot_port")
"""Settings by which reactions find the robot, unless their rules have its address."""
_VARIABLES = ("wrist_fields", "link_wrenches")
"""Those of `READERS` that have no option."""


def open_source(settings: Settings, scene: Scene) -> Callable[[Scene], LiveSource | PushSource] | None:
    """Return a picklable factory of the source of samples; None if no robot is configured.

    Raises:
        SettingsError: As for `reader_settings`.
    """
    readers = reader_settings(settings, scene)
    if readers is not None:
        return partial(LiveSource, settings=readers)
    if settings.controllers.source == "push":
        return partial(PushSource, path=settings.controllers.socket_path)
    return None


def reader_settings(settings: Settings, scene: Scene) -> SourceSettings | None:
    """How the robot and its sensors are read; None if no robot is configured, or its controller sends the
    samples itself.

    Raises:
        SettingsError: The scene requires a signal that these settings do not provide, or some of them are
            without effect.
    """
    readers = [name for name in READERS if name in settings.model_fields_set]
    if settings.controllers.source == "push":
        readers = [name for name in readers if name not in _REACTIONS_TOO]
        if readers:
            raise OptionsError(
                f"{_option(readers[0])} is for samples that are read from the robot: expected it without "
                "--source push, where the controller sends them"
            )
        return None
    if settings.robot_host is None:
        if readers:
            raise OptionsError(
                f"{_option(readers[0])} is read together with the robot: expected --robot-host too, got none"
            )
        return None
    if len(scene.robot.joints) != JOINTS:
        raise SettingsError(
            f"--robot-host: expected an arm with {JOINTS} joints, as RTDE has them, got "
            f"{scene.robot.name} with {len(scene.robot.joints)}; its controller can send its samples "
            "itself: --source push"
        )
    if scene.base_wrench is not None and (settings.ft_host is None) == (settings.ft_fields is None):
        raise OptionsError(
            "the scene has a force/torque sensor under the base: expected either its address "
            "(--ft-host) or six RTDE fields (--ft-fields), got "
            f"{'both' if settings.ft_host else 'neither'}; set base_wrench: null in the scene to run without "
            "it"
        )
    sources = SourceSettings(
        robot_host=settings.robot_host,
        robot_port=settings.robot_port,
        client=settings.robot_client,
        frequency=settings.robot_rate,
        wrench_host=settings.ft_host,
        wrench_port=settings.ft_port,
        wrench_http_port=settings.ft_http_port,
        wrench_counts=settings.ft_counts,
        wrench_rate=settings.ft_rate,
        wrench_fields=settings.ft_fields or (),
        wrist_fields=settings.wrist_fields,
        link_wrenches={name: source.source for name, source in settings.link_wrenches.items()},
        constant_readings=settings.constant_readings,
    )
    try:
        # Try without sensors on the network, because their clients would connect at once.
        remote = {name for name, source in sources.link_wrenches.items() if source.host is not None}
        local = tuple(sensor for sensor in scene.link_wrenches if sensor.name not in remote)
        tried = scene.model_copy(update={"base_wrench": None, "link_wrenches": local})
        LiveSource(tried, sources).close()
    except SensorError as error:
        raise SettingsError(str(error)) from None
    return sources


def check_robot_address(settings: Settings, rules: ReactionRules | None) -> None:
    """Check that the robot's address is of use: where a controller sends the samples, only reactions
    connect to the robot, and their rules may have its address.

    Args:
        settings: The settings of the service.
        rules: The rules; None if there are none.

    Raises:
        OptionsError: It is without effect.
    """
    given = [name for name in _REACTIONS_TOO if name in settings.model_fields_set]
    if settings.controllers.source != "push" or not given:
        return
    if rules is None:
        why = "there are no rules"
    elif rules.robot.host is not None:
        why = f"the rules have the robot's address, {rules.robot.host}"
    elif settings.robot_host is None:
        why = "there is no --robot-host"
    else:
        return
    raise OptionsError(
        f"{_option(given[0])} is for reactions only with --source push, where the controller sends the "
        f"samples: expected none, as {why}"
    )


def unused(settings: Settings, scene: Scene) -> tuple[str, ...]:
    """Settings that have no effect with this scene or without another one, one readable line each."""
    controllers, found = settings.controllers, []
    if controllers.xmlrpc_port is None and controllers.line_port is None:
        found = [
            f"--controller-{name} is not used: expected --xmlrpc-port or --line-port beside it"
            for name in ("host", "clients")
            if name in controllers.model_fields_set
        ]
    given = settings.ft_host is not None or settings.ft_fields is not None
    if scene.base_wrench is None and given and settings.controllers.source == "robot":
        option = "--ft-host" if settings.ft_host is not None else "--ft-fields"
        found.append(f"{option} is not used: the scene has no base_wrench")
    return tuple(found)


def _option(name: str) -> str:
    """How the user writes a setting of the readers."""
    return PREFIX + name.upper() if name in _VARIABLES else f"--{name.replace('_', '-')}"
