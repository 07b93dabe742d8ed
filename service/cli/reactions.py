"""`contactsense reactions`: describes rules in words, and finds when they would have fired."""

import json
import sys
from pathlib import Path
from typing import Any

import click
from pydantic import ValidationError

from contactsense import Localizer, Scene, SceneError
from contactsense.runtime.block_runner import MAX_BLOCK
from contactsense.scene import describe
from contactsense.service.percent import in_percent
from contactsense.service.reactions.decision import Decision
from contactsense.service.reactions.engine import Engine
from contactsense.service.reactions.explain import explain, explain_actions, explain_expected
from contactsense.service.reactions.rules import ReactionRules, RulesError
from contactsense.service.recordings import MappingError, Recording, RecordingError, read
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.recording_file import carried_scene_in

_OFTEN = 0.05
"""It is told if a larger share of the samples of a recording is degraded."""


@click.group()
def reactions() -> None:
    """Rules for reactions to contacts."""


@reactions.command(short_help="Describe rules in words; replay recordings.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--scene", "scene_file", type=click.Path(path_type=Path), help="Scene file (YAML).")
@click.option(
    "--robot",
    help="Robot where there is no scene file.  [default: with --replay the scene that the recording carries, "
    "else ur5e]",
)
@click.option(
    "--replay", type=click.Path(path_type=Path), help="Recording: print when the rules would have fired."
)
@click.option(
    "--columns", help="With --replay: column names and units, as q=joint,time_unit=ms or a YAML file."
)
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def check(
    file: Path,
    scene_file: Path | None,
    robot: str | None,
    replay: Path | None,
    columns: str | None,
    as_json: bool,
) -> int:
    """Check the rules in FILE and describe each in words, then each action.

    Warns of groups with the name of a link, of programs and files that actions need and that this computer
    does not have, and of what needs `contactsense serve --journal`.

    With --replay, no contact is announced. A latched collision is acknowledged as soon as nothing touches the
    arm, so that each time at which a collision level would have been exceeded is shown.
    """
    try:
        scene = _scene(scene_file, robot, replay)
        rules = ReactionRules.load(file)
        try:
            rules.check(scene)
        except RulesError as error:
            raise RulesError(f"{file}: {error}") from None
        fired = None if replay is None else _fired(rules, scene, read(replay, scene, columns))
    except (RulesError, SceneError, RecordingError, MappingError) as error:
        raise click.ClickException(str(error)) from None
    for text in (*rules.shadowed_links(scene), *rules.missing, *rules.without_journal):
        click.echo(f"warning: {text}", err=True)
    if as_json:
        report: dict[str, Any] = {
            "rules": [explain(rules, rule, scene) for rule in rules.rules],
            "actions": explain_actions(rules),
            "shadowed_links": rules.shadowed_links(scene),
            "missing": rules.missing,
            "without_journal": rules.without_journal,
        }
        if fired is not None:
            report["fired"] = [decision.as_dict() for decision in fired]
        click.echo(json.dumps(report))
        return 0
    for rule in rules.rules:
        click.echo(explain(rules, rule, scene))
    for name, text in explain_actions(rules).items():
        click.echo(f"action {name}: {text}.")
    for window in rules.expected:
        click.echo(explain_expected(rules, window, scene))
    if fired is not None:
        _print(fired, replay)
    return 0


def _scene(file: Path | None, robot: str | None, replay: Path | None) -> Scene:
    if file is not None and robot is not None:
        raise click.UsageError("--robot and --scene: expected one of them, got both")
    if file is not None:
        return Scene.load(file)
    if robot is None and replay is not None and (carried := carried_scene_in(replay)) is not None:
        return carried
    try:
        return Scene.model_validate({"robot": robot or "ur5e"})
    except ValidationError as error:
        raise SceneError(describe(error, Scene)) from None
    except LookupError as error:
        raise SceneError(str(error.args[0] if error.args else error)) from None


def _fired(rules: ReactionRules, scene: Scene, recording: Recording) -> list[Decision]:
    """The levels that would have begun.

    Raises:
        RecordingError: No sample could be used, so it is not known.
    """
    localizer, engine = Localizer(scene), Engine(rules, scene)
    localizer.reset()
    fired: list[Decision] = []
    degraded = 0
    with click.progressbar(
        recording.samples(), length=len(recording.t), label="replaying", file=sys.stderr
    ) as samples:
        for sample in samples:
            estimate = localizer.step(sample)
            degraded += estimate.status == "degraded"
            fired += [decision for decision in engine.step(sample, estimate) if decision.kind == "begin"]
            if estimate.status == "none" and engine.latches:
                engine.acknowledge()
    told = [*problem_lines(recording.problems), *localizer.refusals]
    if localizer.doubt:
        told.append(localizer.doubt)
    if degraded > _OFTEN * len(recording.t):
        told.append(
            f"estimates were degraded in {in_percent(degraded / len(recording.t))} of the samples; "
            "`contactsense analyze` says more"
        )
    for text in told:
        click.echo(f"check: {text}", err=True)
    if not fired and not _is_usable(scene, recording):
        raise RecordingError(
            f"{recording.name}: no sample could be used: whether a rule would have fired is not known; "
            "`contactsense analyze` says why"
        )
    return fired


def _is_usable(scene: Scene, recording: Recording) -> bool:
    """Whether a contact could have been found in any sample."""
    blocks = Localizer(scene).run_blocks(recording.sample_blocks(MAX_BLOCK))
    return any(bool(block.usable.any()) for block in blocks)


def _print(fired: list[Decision], replay: Path | None) -> None:
    if not fired:
        click.echo(f"{replay}: no rule would have fired")
        return
    times = "once" if len(fired) == 1 else f"{len(fired)} times"
    click.echo(f"{replay}: a level would have been exceeded {times}")
    click.echo(f"{'t [s]':>10}  {'rule':<16} {'level':<10} {'link':<12} {'force [N]':>9}  P      actions")
    for d in fired:
        click.echo(
            f"{d.t:10.3f}  {d.rule:<16} {d.level:<10} {d.link or '?':<12} {d.force:9.1f}  "
            f"{d.probability:.3f}  {', '.join(d.actions) or '-'}"
        )
