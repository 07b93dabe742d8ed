"""The rules file, `reactions.yaml`: which force on which link leads to which actions."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from contactsense.robots.files.file_model import FileModel
from contactsense.robots.files.yaml_fields import read_fields
from contactsense.robots.units import FURTHEST, in_metres
from contactsense.scene import Scene, describe
from contactsense.scene_model.reading_limits import LARGEST_FORCE
from contactsense.service.reactions.actions import Action
from contactsense.service.reactions.actions.speed_slider import SpeedSliderAction

ANY, TOOL = "any", "tool"
"""Names in `links` for all links, and for the scene's tool regardless of its name."""
Three = tuple[float, float, float]
Force = Annotated[float, Field(gt=0.0, le=LARGEST_FORCE)]
"""Readings beyond the largest force are not used: a level above it would never begin [N]."""


RTDE_PORT = 30004
"""The RTDE port of a controller."""


class RulesError(ValueError):
    """The rules cannot be used: the message names file and field, what was expected and what was given."""


class RulesModel(FileModel):
    """Part of a rules file; docs/reaction_fields.md is made from what is written below each field."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class Level(RulesModel):
    """A level of force and the actions that it triggers."""

    force: Force
    """Level that the force must exceed [N]."""
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.9
    """Smallest probability that the force exceeds the level."""
    duration: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """How long this must hold without interruption [s]."""
    release: Annotated[float, Field(gt=0.0, le=1.0)] = 0.8
    """The level ends when the force no longer exceeds this fraction of `force` with that probability."""
    actions: tuple[str, ...] = ()
    """Names of actions, started in this order."""


class Direction(RulesModel):
    """A cone of directions: forces on the robot outside it do not count."""

    axis: Three
    """Axis of the cone; any length except zero."""
    half_angle: Annotated[float, Field(gt=0.0, le=3.141592653589793)]
    """Largest angle between the force and the axis [rad]."""
    frame: Literal["base", "link"] = "base"
    """Frame in which the axis is given."""

    @model_validator(mode="after")
    def _has_an_axis(self) -> Self:
        if not any(self.axis):
            raise ValueError("axis: expected a direction, got three zeros")
        return self


class Rule(RulesModel):
    """Levels for some links."""

    name: str
    """Name of the rule: in events, and to acknowledge its collision."""
    links: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names of links or groups, `tool`, or `any`."""
    contact: Level | None = None
    """The lower level: it ends when the force has ended."""
    collision: Level | None = None
    """The upper level: it latches until it is acknowledged."""
    condition: Annotated[Literal["moving", "rest", "any"], Field(alias="while")] = "any"
    """Whether the rule applies only while the arm moves, only at rest, or always."""
    direction: Direction | None = None
    """Directions of force that count; None: all."""
    on_degraded: Literal["act", "hold", "ignore"] = "act"
    """Behaviour with a `degraded` estimate. `act`: treat it like any other, but keep active levels if it has
    no contacts. `hold`: no level begins or ends. `ignore`: treat it as free of contact."""

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.contact is None and self.collision is None:
            raise ValueError("expected a level `contact` or `collision`, got neither")
        if self.contact and self.collision and self.collision.force < self.contact.force:
            raise ValueError(
                f"collision.force: expected at least contact.force ({self.contact.force:g} N), "
                f"got {self.collision.force:g} N"
            )
        return self


class ExpectedContact(RulesModel):
    """A contact that the robot program may announce: while its window is open, higher levels apply to such a
    contact. The file defines what can be announced and up to which force; a request only names it."""

    name: str
    """Name by which a request announces it."""
    links: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names of links or groups, `tool`, or `any`."""
    point: Annotated[Three, AfterValidator(in_metres)] | None = None
    """Expected point, base frame [m]; None: anywhere on the links."""
    radius: Annotated[float, Field(gt=0.0, le=FURTHEST)] = 0.05
    """Largest distance from `point` [m]."""
    force: Force
    """Force to which the levels of all rules are raised [N]."""
    timeout: Annotated[float, Field(gt=0.0, le=3600.0)] = 10.0
    """The window closes after this time at the latest [s, robot's clock]."""
    value: Annotated[int, Field(ge=1, le=2**31 - 1)] | None = None
    """Value of `inputs.announce` that opens the window; None: only a request can open it."""


def _output(**registers: range) -> BeforeValidator:
    """Accepts the names of these registers, which a robot program writes: their kind -> their numbers."""
    names = {f"output_{kind}_register_{i}" for kind, numbers in registers.items() for i in numbers}
    expected = " or ".join(f"output_{kind}_register_{of[0]} to {of[-1]}" for kind, of in registers.items())

    def check(value: Any) -> Any:
        if isinstance(value, int) and not isinstance(value, bool):  # it does not say which kind is meant
            raise ValueError(
                f"expected the name of a register, such as output_int_register_24, got the number {value}"
            )
        if isinstance(value, str) and value not in names:
            raise ValueError(f"expected {expected}, got {value!r:.60}")
        return value

    return BeforeValidator(check)


_BITS, _INTEGERS = range(64, 128), range(48)
_AcknowledgeRegister = Annotated[str, _output(bit=_BITS, int=_INTEGERS)]
_AnnounceRegister = Annotated[str, _output(int=_INTEGERS)]


class Inputs(RulesModel):
    """Output registers of the robot program that the service reads."""

    acknowledge: _AcknowledgeRegister | None = None
    """Bit or integer register, such as `output_bit_register_64`; a change from 0 to another value
    acknowledges all collisions."""
    announce: _AnnounceRegister | None = None
    """Integer register, such as `output_int_register_24`, that opens the window of an expected contact by its
    `value`; 0 closes it."""


class RobotAddress(RulesModel):
    """The controller to which actions are sent."""

    host: Annotated[str, Field(min_length=1)] | None = None
    """Address of the robot's controller; None: the controller that sends the samples."""
    rtde_port: Annotated[int, Field(ge=1, le=65535)] | None = None
    """Its RTDE port; None: that of the controller that sends the samples, and 30004 where `host` is given."""


class ReactionRules(RulesModel):
    """Content of a rules file."""

    robot: RobotAddress = RobotAddress()
    """The controller to which actions are sent."""
    moving_speed: Annotated[float, Field(gt=0.0, le=10.0)] = 0.02
    """The arm moves when a joint is faster than this [rad/s]."""
    groups: dict[str, Annotated[tuple[str, ...], Field(min_length=1)]] = Field(default_factory=dict)
    """Name of a group -> its links and further groups."""
    inputs: Inputs = Inputs()
    """Output registers of the robot program that the service reads."""
    actions: dict[str, Action] = Field(default_factory=dict)
    """Name -> action."""
    rules: Annotated[tuple[Rule, ...], Field(min_length=1)]
    """The rules."""
    expected: tuple[ExpectedContact, ...] = ()
    """Contacts that the robot program may announce."""

    @field_validator("groups")
    @classmethod
    def _has_no_group_any(cls, groups: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        if ANY in groups:
            raise ValueError(f"expected names of groups other than {ANY!r}, which stands for all links")
        return groups

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        for what, names in (
            ("rules", [rule.name for rule in self.rules]),
            ("expected", [window.name for window in self.expected]),
            ("expected: value", [str(window.value) for window in self.expected if window.value]),
        ):
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise ValueError(f"{what}: expected different names, got {twice[0]!r} twice")
        for rule in self.rules:
            for level in (rule.contact, rule.collision):
                for action in level.actions if level is not None else ():
                    if action not in self.actions:
                        raise ValueError(
                            f"rules: {rule.name}: expected actions of {', '.join(self.actions) or 'none'}, "
                            f"got {action!r}"
                        )
        for kind in ("registers", "speed_slider"):
            if sum(action.type == kind for action in self.actions.values()) > 1:
                raise ValueError(f"actions: expected at most one of type {kind}, got more")
        return self

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read rules from a YAML file.

        Raises:
            RulesError: The file is missing, is not YAML, or a field is wrong; the message names it.
        """
        try:
            content = read_fields(path, "the rules", "rules:")
        except ValueError as error:
            raise RulesError(str(error)) from None
        try:
            return cls.model_validate(content, context={"folder": Path(path).parent})
        except ValidationError as error:
            raise RulesError(f"{path}: {describe(error, cls)}") from None

    def links_of(self, names: tuple[str, ...], scene: Scene) -> frozenset[str]:
        """Return the links of the scene for names of links and groups, `tool` and `any`.

        Raises:
            RulesError: There is no such link, or a group contains itself.
        """
        return self._links_of(names, scene, ())

    def _links_of(self, names: tuple[str, ...], scene: Scene, inside: tuple[str, ...]) -> frozenset[str]:
        """The same; `inside`: the groups that are being looked into, whose names there are those of links."""
        found: set[str] = set()
        for name in names:
            if name in self.groups and name not in inside:
                found |= self._links_of(self.groups[name], scene, (*inside, name))
            elif name == ANY:
                found |= set(scene.link_names)
            elif name == TOOL and scene.tool is not None and scene.tool.name in scene.link_names:
                found.add(scene.tool.name)
            elif name in scene.link_names:
                found.add(name)
            elif name in inside:
                way = inside[inside.index(name) + 1 :]
                through = f", through {', '.join(way)}" if way else ""
                raise RulesError(f"group {name} contains itself{through}")
            else:
                known = (*scene.link_names, *self.groups, ANY)
                hint = "; the scene has no tool with a surface" if name == TOOL else ""
                raise RulesError(f"links: expected some of {', '.join(known)}, got {name!r}{hint}")
        return frozenset(found)

    def shadowed_links(self, scene: Scene) -> tuple[str, ...]:
        """Groups with the name of a link, or `tool`, one readable line each: in rules the name stands for the
        group.

        Raises:
            RulesError: A link is unknown.
        """
        found = []
        for name in self.groups:
            if name in (TOOL, *scene.link_names):
                links = self.links_of((name,), scene)
                of_group = ", ".join(link for link in scene.link_names if link in links)
                found.append(f"group {name} has the name of a link: in rules {name} stands for {of_group}")
        return tuple(found)

    @property
    def missing(self) -> tuple[str, ...]:
        """What actions need on this computer and do not find, one readable line each."""
        found = {name: action.missing() for name, action in self.actions.items()}
        return tuple(f"action {name}: {text}" for name, text in found.items() if text)

    @property
    def without_journal(self) -> tuple[str, ...]:
        """What a service without a journal in a file does not do, one readable line each."""
        return tuple(
            f"action {name}: without --journal FILE the speed slider stays low if the service ends while it "
            "is lowered: no later start raises it"
            for name, action in self.actions.items()
            if isinstance(action, SpeedSliderAction) and action.restore is not None
        )

    def check(self, scene: Scene) -> None:
        """Check that the rules fit the scene.

        Raises:
            RulesError: A link is unknown; the message names the rule.
        """
        named: list[tuple[str, tuple[str, ...]]] = [(f"groups: {k}", (k,)) for k in self.groups]
        named += [(f"rules: {rule.name}", rule.links) for rule in self.rules]
        named += [(f"expected: {window.name}", window.links) for window in self.expected]
        for where, links in named:
            try:
                self.links_of(links, scene)
            except RulesError as error:
                raise RulesError(f"{where}: {error}") from None
