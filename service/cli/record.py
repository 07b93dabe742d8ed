"""`contactsense record`: writes live samples, or a recording in another format, to disk."""

import contextlib
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from contactsense.scene import Scene, SceneError
from contactsense.scene_model.sensor_delays import without_delays
from contactsense.service.api.http.token_file import TokenError, read_token
from contactsense.service.api.sample_source import reader_settings
from contactsense.service.api.scene_file import load_scene
from contactsense.service.api.settings import OptionsError, Settings, SettingsError
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.cli.options.option_names import as_options, refusal
from contactsense.service.cli.options.output_file import check_no_input, check_writable
from contactsense.service.cli.options.sensor_options import from_environment, sensor_options
from contactsense.service.cli.record_by_service import record_by_service
from contactsense.service.group_signals import ignored
from contactsense.service.live.scheduling import RECORDER, prefer_low_latency, prioritize
from contactsense.service.recordings import ColumnMapping, MappingError, RecordingError, read, scene_in
from contactsense.service.recordings.export import RECORDINGS, check_format, export
from contactsense.service.recordings.file_names import check_name
from contactsense.service.recordings.problem_lines import problem_lines
from contactsense.service.recordings.writing.recorder import Recorder
from contactsense.service.recordings.writing.segment_writer import Rotation
from contactsense.service.sensors.clients.robot_stream import SensorError, StreamHealth
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.viewer.service_calls import LiveError, ServiceCalls


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="Folder; with --from, a file.")
@click.option("--url", help="Let this running service record into its own folder (serve --recordings DIR).")
@click.option("--token-file", type=click.Path(path_type=Path), help="File with that service's token.")
@click.option("--scene", type=click.Path(path_type=Path), help="Scene file (YAML).")
@click.option("--robot", help="Robot to assume where there is no scene file.  [default: ur5e]")
@sensor_options("Address of the robot's controller.")
@click.option("--fields", default="", help="Further RTDE fields to record, separated by commas.")
@click.option("--seconds", type=FiniteRange(0.0, min_open=True), help="Stop after this time [s].")
@click.option(
    "--rotate-seconds",
    type=FiniteRange(1.0),
    default=600.0,
    show_default=True,
    help="Start a new file after this time [s].",
)
@click.option(
    "--rotate-mb", type=FiniteRange(1.0), default=256.0, show_default=True,
    help="Start a new file at this size before compression [MB].",
)  # fmt: skip
@click.option(
    "--disk-limit-mb",
    type=FiniteRange(1.0),
    help="Remove the oldest files of a table beyond this total size [MB].",
)
@click.option(
    "--from", "origin", type=click.Path(path_type=Path), help="Convert this recording instead of a live arm."
)
@click.option(
    "--columns", help="With --from: column names and units, as q=joint,time_unit=ms or a YAML file."
)
def record(
    out: Path | None,
    url: str | None,
    token_file: Path | None,
    fields: str,
    seconds: float | None,
    rotate_seconds: float,
    rotate_mb: float,
    disk_limit_mb: float | None,
    origin: Path | None,
    columns: str | None,
    **source: Any,
) -> None:
    """Record the robot and its force/torque sensor, or convert a recording (--from FILE --out FILE).

    Files are Parquet with the scene in their metadata. While a file is being written it is an Arrow stream
    (.arrows): if this program is killed, at most 0.5 s are lost, and the next start completes the file.
    With --from, the format follows from the name of --out: .parquet, .csv or .mcap. With --url, the service
    records its samples as they are used, with their estimates, until this command ends.
    """
    if (out is None) == (url is None):
        raise click.UsageError("record: expected either --out or --url")
    given = {name: value for name, value in source.items() if value is not None}
    if url is not None:
        _refuse_others("--url", {"seconds", "token_file"})
    elif origin is not None:
        _refuse_others("--from", {"out", "scene", "columns"})
    elif columns is not None:
        raise click.UsageError("--columns is for --from, which is not given")
    elif token_file is not None:
        raise click.UsageError("--token-file is for --url, which is not given")
    try:
        if url is not None:
            token = None if token_file is None else read_token(token_file)
            record_by_service(ServiceCalls(url, token), seconds)
            return
        assert out is not None
        check_name(out)
        if origin is not None:
            _convert(origin, out, given.get("scene"), columns)
            return
        settings = Settings.checked({**from_environment("scene", "robot"), **given}, "record", as_options())
        scene = load_scene(settings)
        reader = reader_settings(settings, scene)
        if reader is None:
            raise OptionsError("record: expected --robot-host, the address of a robot, got none")
        extra = tuple(name.strip() for name in fields.split(",") if name.strip())
        rotation = Rotation(rotate_seconds, rotate_mb, disk_limit_mb)
        recorder = Recorder(out, scene, rotation, rate=settings.robot_rate)
        # Readings stay in the row in which they were received, as in any other recording.
        plain = without_delays(scene)
        prioritize(RECORDER)  # before the threads that read sensors are started
        prefer_low_latency()
        with contextlib.closing(LiveSource(plain, replace(reader, extra_fields=extra))) as live:
            live.observer = recorder
            _run(live, recorder, seconds, out)
    except (
        SettingsError, SensorError, RecordingError, MappingError, SceneError, LiveError, TokenError,
    ) as error:  # fmt: skip
        raise refusal(error) from None


def _refuse_others(mode: str, allowed: set[str]) -> None:
    """Refuse options that have no effect beside that of `mode`."""
    ctx = click.get_current_context()
    for option in ctx.command.params:
        source = ctx.get_parameter_source(option.name or "")
        if source is ParameterSource.COMMANDLINE and option.opts[0] != mode and option.name not in allowed:
            raise click.UsageError(f"{option.opts[0]} has no effect with {mode}: expected one of the two")


def _run(live: LiveSource, recorder: Recorder, seconds: float | None, out: Path) -> None:
    console = Console(stderr=True, markup=False)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    end = None if seconds is None else time.monotonic() + seconds
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("waiting for the robot")
        shown = 0.0
        with contextlib.suppress(KeyboardInterrupt):
            while end is None or time.monotonic() < end:
                live.poll(0.1)
                now = time.monotonic()
                if now - shown >= 0.5:
                    shown = now
                    progress.update(task, description=_state(live, recorder))
        # Whoever presses Ctrl-C twice would leave the last file incomplete.
        with ignored(signal.SIGINT, signal.SIGTERM):
            files = recorder.close()
    health = live.health
    for path in recorder.repaired:
        console.print(f"completed from an earlier run: {path.name}", highlight=False)
    size = sum(path.stat().st_size for path in files if path.exists()) / 1e6
    click.echo(
        f"{recorder.rows} samples and {recorder.readings} force/torque readings in {_files(len(files))} in "
        f"{out} ({size:.1f} MB), {health.losses or 0} lost"
        + _interruptions(health.robot)
        + (
            f"; the oldest were removed to keep --disk-limit-mb: {_files(recorder.removed)}"
            if recorder.removed
            else ""
        )
    )
    if recorder.rows == 0:
        raise click.ClickException(f"nothing was recorded: {health.trouble or 'no samples arrived'}")


def _interruptions(robot: StreamHealth) -> str:
    """What is missing beside what was lost: a controller that starts anew begins its clock anew, so that
    nobody knows how many samples there would have been."""
    if robot.connections < 2:
        return ""
    return f"; the robot had to be connected {robot.connections} times ({robot.error})"


def _files(count: int) -> str:
    return "1 file" if count == 1 else f"{count} files"


def _state(live: LiveSource, recorder: Recorder) -> str:
    health = live.health
    trouble = health.trouble
    text = f"{recorder.rows} samples, {health.losses or 0} lost"
    return f"{text}; {trouble}" if trouble else text


def _convert(origin: Path, out: Path, scene_path: Path | None, columns: str | None) -> None:
    check_no_input("--out", out, [origin])  # the new file has only the columns that were read
    check_writable("--out", out)
    check_format(out, RECORDINGS)
    scene = scene_in(origin) if scene_path is None else Scene.load(scene_path)
    # What is written has the sensors' delays, too.
    recording = read(origin, without_delays(scene), ColumnMapping.parse(columns))
    console = Console(stderr=True, markup=False)
    for problem in problem_lines(recording.problems):
        console.print(f"{origin}: {problem}", highlight=False, soft_wrap=True)
    export(recording, out, scene=scene)
    count = f"{len(recording)} sample{'' if len(recording) == 1 else 's'}"
    click.echo(f"{count}, {recording.seconds:.1f} s, written to {out}")
