"""State of the pipeline and its sensors, as the service reports it."""

from typing import Literal

from pydantic import BaseModel, Field


class SensorHealth(BaseModel):
    """Stream of one sensor since the pipeline started."""

    state: Literal["connecting", "streaming", "waiting", "closed"] = Field(
        "connecting", description="streaming: readings come; waiting: it is silent or away and tried again."
    )
    received: int = Field(0, description="Readings received.")
    lost: int = Field(
        0, description="Readings that it took and that never arrived, by gaps in their numbering."
    )
    last_error: str = Field("", description="The latest error; kept after recovery.")
    last_error_time: str | None = Field(
        None, description="When it was last the case, ISO 8601 in UTC; null where there was none."
    )


class SourceHealth(BaseModel):
    """State of the sensors."""

    connected: bool = Field(False, description="Whether samples come from the robot.")
    trouble: str = Field("", description="What is wrong at this moment; empty if nothing is.")
    rate: float = Field(0.0, description="Samples a second over the last second [Hz].")
    age: float | None = Field(None, description="Time since the last sample [s]; null before the first.")
    without_wrench: int = Field(0, description="Samples without the base sensor's reading.")
    unusable: int = Field(
        0, description="Samples left out, as their positions or velocities could not be used."
    )
    robot: SensorHealth = Field(SensorHealth(), description="The robot's controller.")
    base_wrench: SensorHealth | None = Field(
        None, description="The force/torque sensor under the base; null where none is read over the network."
    )
    link_wrenches: dict[str, SensorHealth] = Field(
        {},
        description="Those within the arm that are read over the network, by their name in the scene's "
        "link_wrenches.",
    )


class PipelineHealth(BaseModel):
    """State of the process that turns samples into estimates."""

    alive: bool = Field(False, description="Whether it runs and answers.")
    restarts: int = Field(0, description="How often it was restarted.")
    scheduling: Literal["real time", "short slices", "normal"] = Field(
        "normal",
        description="How urgently the system lets it run; reactions are in time on a busy computer only "
        "with real time.",
    )
    dropped: int = Field(0, description="Estimates that could not be handed over in time.")
    step: float | None = Field(None, description="Recent typical time per sample [s].")
    listener_errors: int = Field(
        0,
        description="Exceptions of listeners, such as reactions or recorder, and commands to them that were "
        "refused.",
    )
    last_listener_error: str = Field("", description="The latest of them.")
    message_errors: int = Field(
        0, description="Messages of the process that the web process could not handle, such as events."
    )
    last_message_error: str = Field("", description="Why the latest of them could not be handled.")
    step_counts: list[int] = Field(
        [],
        description="Steps by their time: up to 20, 50, 100, 200, 500 us, 1, 2, 5, 10, 100 ms, more.",
    )
    step_sum: float = Field(0.0, description="Time of all steps together [s].")
    estimates: int = Field(0, description="Estimates that arrived at the web process.")
    estimate_age: float | None = Field(
        None, description="Time since the latest estimate arrived [s]; null before the first."
    )
    report_age: float | None = Field(
        None, description="Time since the process's latest message [s]; null before the first."
    )
    handover: float | None = Field(
        None, description="How long its latest report took to the web process [s]; null before the first."
    )
