"""Actions, one file each: the settings in the rules file, and the code that performs the action."""

from typing import Annotated

from pydantic import Field

from contactsense.service.reactions.actions.command import CommandAction
from contactsense.service.reactions.actions.dashboard import DashboardAction
from contactsense.service.reactions.actions.polyscope_x import PolyscopeXAction
from contactsense.service.reactions.actions.registers import RegistersAction
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction
from contactsense.service.reactions.actions.stop_program import StopProgramAction
from contactsense.service.reactions.actions.ur_rtde_stop import UrRtdeStopAction
from contactsense.service.reactions.actions.webhook import WebhookAction

Action = Annotated[
    RegistersAction
    | SpeedSliderAction
    | StopProgramAction
    | DashboardAction
    | PolyscopeXAction
    | UrRtdeStopAction
    | CommandAction
    | WebhookAction,
    Field(discriminator="type"),
]
"""Any action."""
