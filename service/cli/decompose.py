"""`contactsense decompose`: fit a few convex primitives to the meshes of each link."""

import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from contactsense.robots import Robot, RobotError
from contactsense.robots.extras import install_command
from contactsense.robots.files.suffixes import URDF_SUFFIXES
from contactsense.robots.files.whole_file import write_text
from contactsense.robots.surface.deviation_table import lines
from contactsense.service.cli.decompose_fits import PROGRESS_COLUMNS, fit_all, fit_by_parts
from contactsense.service.cli.measured_surface import measured_again
from contactsense.service.cli.options.finite_range import FiniteRange
from contactsense.service.cli.options.output_file import check_writable
from contactsense.service.cli.options.picture_file import PicturePath

if TYPE_CHECKING:
    import trimesh

    from contactsense.robots.decomposition.decompose import Fit, Options

_WIDEST = 500
"""Width beyond which no table grows [characters]."""


@click.command()
@click.argument("arm")
@click.option(
    "--meshes",
    type=click.Path(path_type=Path),
    help="Folder with <link>.ply (or .dae, .obj, .stl, .glb) in each link's frame, in metres.",
)
@click.option("--source", default="", help="Source of the meshes, for the head of the file.")
@click.option("--tip", help="Last link of the arm in a URDF; else the longest chain of revolute joints.")
@click.option("--as-tool", is_flag=True, help="ARM is a tool: a mesh, or a URDF, in the flange's frame.")
@click.option(
    "--as-body", is_flag=True, help="ARM is a body of the cell: a mesh, or a URDF, in its own frame."
)
@click.option(
    "--scale",
    type=FiniteRange(0.0, min_open=True),
    default=1.0,
    show_default=True,
    help="Metres per unit of the mesh of a tool or body, as 0.001 for mm.",
)
@click.option("--tolerance", default="2mm", show_default=True, help="Wanted 95th percentile of the distance.")
@click.option("--max", "most", type=click.IntRange(min=1), help="Largest number of primitives in total.")
@click.option(
    "--link-max",
    type=click.IntRange(min=1),
    default=8,
    show_default=True,
    help="Largest number of primitives on a link.",
)
@click.option("--no-boxes", is_flag=True, help="Bodies of revolution only.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random numbers; the same seed gives the same result.",
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=2,
    show_default=True,
    help="Links that are fitted at the same time.",
)
@click.option(
    "--measure",
    type=click.Path(path_type=Path),
    help="Keep the primitives of this surface file; measure how far they are from the meshes.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Write the primitives to this YAML file.")
@click.option("--picture", type=PicturePath(), help="Draw skin, primitives and error to this PNG.")
def decompose(
    arm: str,
    meshes: Path | None,
    source: str,
    tip: str | None,
    as_tool: bool,
    as_body: bool,
    scale: float,
    tolerance: str,
    most: int | None,
    link_max: int,
    no_boxes: bool,
    seed: int,
    jobs: int,
    measure: Path | None,
    out: Path | None,
    picture: Path | None,
) -> None:
    """Fit convex primitives to the outer skin of each link of ARM, a URDF or a name that `contactsense
    robots` lists; or of a tool or a body of the cell, a mesh or a URDF, with --as-tool or --as-body.

    Writes the surface of an arm, or the field `tool` or `bodies` of a scene. Movable joints that are not the
    arm's, such as a gripper's, are held at zero. Without --out the YAML goes to standard output, and the
    table of errors to standard error.
    """
    try:
        from contactsense.robots.decomposition.decompose import Options, choose
        from contactsense.robots.decomposition.mesh_size import too_large
        from contactsense.robots.decomposition.mesh_sources import read_arm, read_tool
    except ImportError as error:
        raise click.ClickException(
            f"decompose needs the extra packages: {install_command('geometry')} ({error})"
        ) from error
    rigid = _rigid_option(as_tool, as_body)
    _check_combination(rigid, meshes is not None or tip is not None, scale)
    if measure is not None and (rigid or picture is not None):
        raise click.UsageError(f"--measure: expected no {rigid or '--picture'}")
    check_writable("--out", out)
    check_writable("--picture", picture)
    options = Options(tolerance=_length(tolerance), most=link_max, seed=seed, boxes=not no_boxes)
    try:
        robot, surfaces = read_tool(Path(arm), scale) if rigid else read_arm(arm, meshes, tip)
    except RobotError as error:
        raise click.ClickException(str(error)) from error
    if Path(arm).suffix.lower() in URDF_SUFFIXES and not rigid:
        click.echo(f"{arm}: {chain_of(robot, tip)}", err=True)
    if robot.held:
        click.echo(f"{arm}: held at zero: {', '.join(robot.held)}", err=True)
    _warn_of_scale(too_large(robot, surfaces))
    if measure is not None:
        _write(measured_again(robot, surfaces, measure), out)
        return
    if not rigid:
        _warn_of_missing_shapes(robot, surfaces)
    start = time.perf_counter()
    fits = fit_all(robot, surfaces, options, jobs)
    seconds = time.perf_counter() - start
    names = list(fits)
    chosen = dict(zip(names, choose([fits[name] for name in names], options.tolerance, most), strict=True))
    best = {name: fits[name][chosen[name]] for name in names}
    if rigid:
        best["tool"] = fit_by_parts(robot.name, surfaces["tool"], best["tool"], options, most, jobs)
    _report(best)
    for line in beyond_tolerance({name: fit.p95 for name, fit in best.items()}, options.tolerance):
        click.echo(line, err=True)
    command = _command(arm, options, most, tip, rigid, scale)
    if rigid:
        rigid_yaml = _tool_yaml if as_tool else _body_yaml
        text = rigid_yaml(robot, best["tool"], command, source or Path(arm).name)
    else:
        text = _yaml(robot, fits, chosen, command, seconds, source)
    _write(text, out)
    if picture is not None:
        _draw(robot, surfaces, best, picture)


def _rigid_option(as_tool: bool, as_body: bool) -> str:
    """The option that makes ARM a single body; empty for an arm."""
    if as_tool and as_body:
        raise click.UsageError("--as-tool, --as-body: expected one of them, got both")
    return "--as-tool" if as_tool else "--as-body" if as_body else ""


def _check_combination(rigid: str, links_given: bool, scale: float) -> None:
    """Options of an arm do not suit a single body, and conversely.

    Args:
        rigid: Option that makes ARM a single body; empty for an arm.
        links_given: Whether --meshes or --tip is given.
        scale: Metres per unit of the mesh.
    """
    if rigid and links_given:
        raise click.UsageError(f"{rigid}: expected no --meshes and no --tip: ARM is a single body")
    if not rigid and scale != 1.0:
        raise click.UsageError("--scale: expected --as-tool or --as-body: the meshes of an arm are in metres")


def _warn_of_missing_shapes(robot: Robot, surfaces: Mapping[str, object]) -> None:
    """Warn of links without a mesh."""
    for link in robot.link_names:
        if link not in surfaces:
            click.echo(f"warning: {link}: no visual shape; it gets no primitives", err=True)


def _warn_of_scale(too_large: Mapping[str, tuple[float, float]]) -> None:
    """Warn of meshes that are larger than their links.

    Args:
        too_large: By name of the link, how far the mesh extends beyond a joint, and how far the joints are
            apart [m].
    """
    for link, (beyond, apart) in too_large.items():
        click.echo(
            f"warning: {link}: its mesh extends {beyond * 1e3:.0f} mm beyond a joint, on a link whose joints "
            f"are {apart * 1e3:.0f} mm apart; is its scale or its origin right?",
            err=True,
        )


def chain_of(robot: Robot, tip: str | None) -> str:
    """Which joints of a URDF are the arm's: a gripper with a single jaw looks like one more.

    Args:
        robot: The arm.
        tip: Its last link, if it was named.
    """
    names = [joint.name for joint in robot.joints]
    chosen = "" if tip else " (--tip names another last link, if some of these joints are a gripper's)"
    return f"joints of the arm: {', '.join(names)}; its last link: {robot.link_names[-1]}{chosen}"


def _write(text: str, out: Path | None) -> None:
    try:
        if out is None:
            click.echo(text, nl=False)
        else:
            write_text(out, text)
    except OSError as error:
        raise click.ClickException(str(error)) from error


def _report(best: "dict[str, Fit]") -> None:
    from contactsense.robots.decomposition.surface_error import HEADINGS, row, together

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for heading in ("link", "primitives", *HEADINGS):
        left = heading == "link"
        table.add_column(
            # In two lines, so that the table fits into 80 columns.
            heading.replace(" p50", "\np50"),
            justify="left" if left else "right",
            no_wrap=True,
            overflow="fold",
        )
    for name, fit in best.items():
        table.add_row(name, str(len(fit.bodies.kind)), *row(fit.errors))
    count = sum(len(fit.bodies.kind) for fit in best.values())
    table.add_row("all", str(count), *row(together([fit.errors for fit in best.values()])))
    # A table that is wider than the terminal is printed whole: a pipe counts as 80 columns.
    Console(stderr=True, width=_WIDEST, markup=False).print(table)


def beyond_tolerance(reached: Mapping[str, float], tolerance: float) -> list[str]:
    """Warnings of links whose `Fit.p95` is beyond the tolerance [m].

    Args:
        reached: It, by name of the link [m].
        tolerance: Of the fit [m].
    """
    worst = {name: value for name, value in reached.items() if value > tolerance}
    if not worst:
        return []
    listed = ", ".join(f"{name} {value * 1e3:.1f} mm" for name, value in worst.items())
    return [
        f"warning: expected 95 % of the distances within {tolerance * 1e3:g} mm, got {listed}; contacts "
        "there may be on wrong links: look at --picture, or allow more primitives with --link-max and --max"
    ]


def _draw(robot: Robot, meshes: "dict[str, trimesh.Trimesh]", best: "dict[str, Fit]", path: Path) -> None:
    from contactsense.robots.decomposition.error_picture import draw_fits

    with Progress(*PROGRESS_COLUMNS, console=Console(stderr=True)) as progress:
        task = progress.add_task("picture: links", total=len(best))
        bodies = {name: fit.bodies for name, fit in best.items()}
        try:
            draw_fits(robot, meshes, bodies, path, drawn=lambda: progress.advance(task))
        except OSError as error:
            raise click.ClickException(str(error)) from error


def _command(
    arm: str, options: "Options", most: int | None, tip: str | None, rigid: str, scale: float
) -> str:
    """The command that makes the file again, apart from a folder of meshes."""
    asked = f"--tolerance {options.tolerance * 1e3:g}mm --link-max {options.most} --seed {options.seed}"
    if most is not None:
        asked += f" --max {most}"
    if not options.boxes:
        asked += " --no-boxes"
    if tip:
        asked += f" --tip {tip}"
    if rigid:
        asked += f" {rigid}" + (f" --scale {scale:g}" if scale != 1.0 else "")
    return f"contactsense decompose {Path(arm).name} {asked}"


def _tool_yaml(robot: Robot, fit: "Fit", command: str, source: str) -> str:
    from contactsense.robots.decomposition.yaml_export import primitives, tool_text

    body = robot.links[-1].inertia
    comments = [
        "Tool for a scene: convex primitives in the flange's frame, in metres.",
        f"Made by: {command}",
        f"Meshes: {source}",
    ]
    if not body.mass > 0.0:
        comments.append("Add mass [kg] and com [m], or let contactsense calibrate estimate them.")
    return tool_text(robot.name, body, primitives(fit.bodies), lines(fit.deviation), comments)


def _body_yaml(robot: Robot, fit: "Fit", command: str, source: str) -> str:
    from contactsense.robots.decomposition.yaml_export import body_text, primitives

    comments = (
        "Body of the cell for a scene: convex primitives in the frame of the mesh, in metres.",
        f"Made by: {command}",
        f"Meshes: {source}",
        "Add translation [m] and rpy [rad] of that frame in the base frame, and the role.",
    )
    return body_text(robot.name, primitives(fit.bodies), lines(fit.deviation), comments)


def _yaml(
    robot: Robot,
    fits: "dict[str, tuple[Fit, ...]]",
    chosen: dict[str, int],
    command: str,
    seconds: float,
    source: str,
) -> str:
    from contactsense.robots.decomposition.yaml_export import primitives, text

    coarse, fine = {}, {}
    for name, found in fits.items():
        coarse[name], fine[name] = found[_coarse(found, chosen[name])], found[chosen[name]]
    links: dict[str, dict[str, Iterable[Any]]] = {
        name: {"coarse": primitives(coarse[name].bodies), "fine": primitives(fine[name].bodies)}
        for name in fits
    }
    deviations = {
        name: {"coarse": lines(coarse[name].moved_deviation), "fine": lines(fine[name].deviation)}
        for name in fits
    }
    comments = (
        f"Surface of the {robot.name}: convex primitives in the link frames, in metres.",
        f"Made by: {command}",
        f"Meshes: {source or 'visual shapes of the URDF'}",
    )
    return text(robot.name, links, comments, seconds, robot.tip, deviations)


def _coarse(fits: "tuple[Fit, ...]", chosen: int) -> int:
    """Number of bodies: one, or two if the second halves the cost."""
    return 1 if chosen >= 1 and fits[1].cost < 0.7 * fits[0].cost else 0


def _length(text: str) -> float:
    """Parse a length such as `2mm`, `0.2cm`, `0.002m` or `0.002`; returns metres."""
    for unit, scale in (("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)):
        if text.endswith(unit):
            try:
                value = float(text.removesuffix(unit)) * scale
            except ValueError:
                break
            if 1e-5 <= value <= 0.1:
                return value
            break
    expected = "expected a length of 0.01mm to 100mm with its unit, such as 2mm"
    raise click.BadParameter(f"{expected}, got {text!r}", param_hint="--tolerance")
