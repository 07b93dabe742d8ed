"""The service over HTTP and WebSocket: a table of routes around the runner, the hub and one localizer.

`create_app` is a factory: `uvicorn --factory contactsense.service.api.app:create_app` takes its settings from
the environment.
"""

import asyncio
import contextlib
import logging
import signal
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import Depends, FastAPI, Query, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import PlainTextResponse
from fastapi_offline import FastAPIOffline
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense import Scene
from contactsense.service.api import clips, errors, events, messages, reactions, track, xmlrpc
from contactsense.service.api.access import Access
from contactsense.service.api.connections import ConnectionLimits
from contactsense.service.api.errors import FieldRefusedError
from contactsense.service.api.limits import Limits, RequestLimits
from contactsense.service.api.messages import (
    ErrorOut,
    EstimateOut,
    EstimatesOut,
    HealthOut,
    LocateIn,
    RobotOut,
    SceneOut,
)
from contactsense.service.api.metrics import CONTENT_TYPE, Metrics
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.controllers.robot_program import NewestEstimate, RobotProgramMethods
from contactsense.service.controllers.robot_program_servers import RobotProgramServers
from contactsense.service.events.journal import Journal, JournalError
from contactsense.service.events.model import ContactEvent
from contactsense.service.live.hub import Hub, Reader
from contactsense.service.live.locate_process import LocateError, LocateProcess, StaticSample
from contactsense.service.live.pipeline_process import ListenerFactory, Source, utc_now
from contactsense.service.live.supervisor import OnLoading, Runner
from contactsense.service.reactions.rules import RulesError
from contactsense.service.reactions.state import Reactions
from contactsense.service.reactions.webhook_delivery import WebhookDelivery

DESCRIPTION = """
Where is a robot arm being touched? Contact location from a force/torque sensor under the base and joint
torques.

**Frames.** Base frame: the robot controller's own. Link frames: as in the robot's description; each link's
frame turns with its joint. **Wrenches** are force then moment, moments about the base origin. **Units** are
SI: m, rad, s, N, Nm.

**Stream.** `WS /v1/stream` sends one `EstimateOut` per sample as JSON text. `?every=10` sends one in ten,
`?rate=30` at most so many per second (0.001 at least). A reader that is too slow loses the oldest and
receives their number, `{"lost": n}`; one that takes nothing for 10 s is dropped.

**WebSocket routes.** OpenAPI has no place for them, hence this table.

| route | parameters | messages from the service | closes with |
| --- | --- | --- | --- |
| `WS /v1/stream` | `every` (1 to 1000000), `rate` [Hz] | `EstimateOut`, or `{"lost": n}` | 1008, 1012 |

Code 1008 follows an `ErrorOut` where a parameter is wrong; 1012 means that the service ends.

**Token.** Where the service has one, each request sends it as `Authorization: Bearer TOKEN`. A WebSocket
may send it instead as the subprotocols `contactsense, bearer.TOKEN`, as browsers can, or as `?token=TOKEN`.
`/v1/ready`, `/docs` and `/openapi.json` need none.

This software is not a safety function.
"""


COMMON_REFUSALS: dict[int, str] = {
    401: "A token is missing or wrong.",
    403: "The request comes from a foreign web page.",
    429: "Too many requests a second from one address.",
}
"""What any route may answer."""

log = logging.getLogger("contactsense")


class Service:
    """What the requests share."""

    def __init__(
        self,
        settings: Settings,
        source: Callable[[Scene], Source] | None,
        on_loading: OnLoading | None = None,
    ) -> None:
        self.scene = settings.load_scene()
        self.hub = Hub(settings.queue)
        self._settings = settings
        if settings.events.path is not None:
            try:
                Journal(settings.events).close()
            except JournalError as error:
                raise SettingsError(str(error)) from None
        self.clips = clips.Clips(settings.recording)
        self.journal: Journal
        """Events; open while the service runs."""
        self.webhooks: WebhookDelivery
        """Webhooks that wait; delivered while the service runs."""
        self.reactions = self._load_reactions(self.scene)
        self._given_source = source
        self.runner = Runner(
            self.scene,
            source or settings.open_source(self.scene),
            self.hub.publish,
            self._hear,
            self._listeners(),
            on_loading,
        )
        self.tracks = track.Tracks(settings.controllers, self.hub)
        newest = NewestEstimate(self.hub, lambda: self.runner.current)
        self.robot_program = RobotProgramMethods(newest, self.reactions)
        self.ports = RobotProgramServers(settings.controllers, self.robot_program)
        self.began = time.monotonic()
        self.connections = ConnectionLimits(
            connections=settings.max_connections, reader_time=settings.reader_timeout
        )
        """Limits of connections, for `http_protocol` and `websocket_protocol`."""
        self.limits = RequestLimits(body=settings.max_body, rate=settings.max_request_rate)
        self.refused: dict[int, int] = {}
        """Requests beyond the limits, by status."""
        self.reload_checks: list[Callable[[Scene], None]] = []
        """Called before a new scene is used; raise `SettingsError` if it, or a file beside it, is invalid."""
        self.reloaded: messages.ReloadHealth | None = None
        self.metrics = Metrics(self.health)
        self._locate = LocateProcess(self.scene)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Pipeline running, kernels on their way, SIGHUP heard."""
        loop = asyncio.get_running_loop()
        self.journal = Journal(self._settings.events)
        self.webhooks = WebhookDelivery(self.journal, self.reactions.webhooks, self._note_webhook)
        self.webhooks.start()
        loading = loop.create_task(self._load())
        self.runner.start()
        reloads: set[asyncio.Task[None]] = set()

        def hang_up() -> None:
            task = loop.create_task(self.reload())
            reloads.add(task)
            task.add_done_callback(reloads.discard)

        hears = threading.current_thread() is threading.main_thread() and hasattr(signal, "SIGHUP")
        if hears:
            loop.add_signal_handler(signal.SIGHUP, hang_up)
        try:
            await self.ports.start()
            yield
        finally:
            if hears:
                loop.remove_signal_handler(signal.SIGHUP)
            loading.cancel()
            self._locate.stop()
            await asyncio.wait([loading, *reloads])
            await self.ports.stop()
            await self.runner.stop()
            await self.webhooks.stop()
            self.journal.close()

    def _hear(self, report: dict[str, Any]) -> None:
        """Take a report of the pipeline's process."""
        kind = report["type"]
        if kind == "event":
            event = ContactEvent.model_validate(report["event"])
            self.record(event if event.time else event.model_copy(update={"time": utc_now()}))
        elif kind == "reactions":
            self.reactions.hear(report)
        elif kind == "webhook":
            self.webhooks.enqueue(report["action"], report["decision"])
        else:
            self.clips.hear(report)

    def _note_webhook(self, name: str, ok: bool, reason: str) -> None:
        event = self.reactions.note_webhook(name, ok, reason)
        self.record(event.model_copy(update={"time": utc_now()}))

    def record(self, event: ContactEvent) -> None:
        """Put an event into the journal and into the stream."""
        self.hub.add_event(self.journal.append(event).model_dump_json().encode())
        if event.kind == "collision" and self.clips.settings.folder is not None:
            self.runner.send(self.clips.request(None, None, f"collision on {event.link}"))

    def _load_reactions(self, scene: Scene) -> Reactions:
        """The rules beside the scene.

        Raises:
            SettingsError: The file cannot be used.
        """
        try:
            rules = self._settings.reactions.load(scene, self._settings.scene)
            return Reactions(rules, self._settings.robot_host, lambda command: self.runner.send(command))
        except RulesError as error:
            raise SettingsError(str(error)) from None

    def _listeners(self) -> tuple[ListenerFactory, ...]:
        factory = self.reactions.factory
        return (*self._settings.listeners(), *(() if factory is None else (factory,)))

    async def _load(self) -> None:
        await self.runner.loaded.wait()  # two processes that compile the same kernels would only be slower
        with contextlib.suppress(LocateError, OSError):  # tried again when it is needed
            await self._locate.start()

    async def reload(self) -> None:
        """Read the scene, and the files beside it, again; if they are invalid, nothing changes."""
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        try:
            scene = await asyncio.to_thread(self._settings.load_scene)
            source = self._given_source or await asyncio.to_thread(self._settings.open_source, scene)
            loaded = self._load_reactions(scene)
            for check in self.reload_checks:
                check(scene)
        except SettingsError as error:
            log.error("reload: nothing has changed: %s", error)
            self.reloaded = messages.ReloadHealth(time=at, ok=False, message=str(error))
            return
        self.scene, self.reactions = scene, loaded
        self.runner.restart(scene, source, self._listeners())
        self._locate.restart(scene)
        log.info("reload: the pipeline is started again with the new scene")
        self.reloaded = messages.ReloadHealth(time=at, ok=True, message="")

    async def locate(self, samples: Sequence[messages.SampleIn], external: bool) -> list[bytes]:
        """Estimates as JSON for static samples.

        Raises:
            LocateError: Not now; the text gives the reason.
        """
        plain = [StaticSample(s.q, s.base_wrench, s.joint_torque, s.wrist_wrench) for s in samples]
        return await self._locate.locate(plain, external)

    @property
    def ready(self) -> bool:
        """Whether the service does its work: estimates are current, or no robot was named."""
        status = self.runner.status
        return status == "idle" or (status in ("ok", "degraded") and self.runner.current)

    def health(self) -> HealthOut:
        """State of the service, computed now."""
        runner, connections = self.runner, self.connections
        source = runner.source.model_copy(update={"age": runner.sample_age})
        pipeline = runner.pipeline.model_copy(
            update={
                "estimates": runner.estimates,
                "estimate_age": runner.estimate_age,
                "report_age": runner.report_age,
                "handover": runner.handover,
            }
        )
        return HealthOut(
            status=runner.status,
            message=runner.message,
            loading=runner.loading,
            loading_left=runner.loading_left,
            reasons=list(runner.reasons),
            ready=self.ready,
            since=runner.since.isoformat(timespec="milliseconds"),
            uptime=time.monotonic() - self.began,
            version=version("contactsense"),
            source=source,
            pipeline=pipeline,
            stream=messages.StreamHealth(readers=self.hub.readers, lost=self.hub.lost),
            reactions=self.reactions.health(),
            clients=messages.ClientHealth(
                connections=connections.opened,
                refused=connections.refused,
                late=connections.late,
                dropped=connections.dropped,
                beyond_limits={str(status): count for status, count in self.refused.items()},
            ),
            lag=runner.lag,
            reload=self.reloaded,
        )


def _service(connection: HTTPConnection) -> Service:
    service: Service = connection.app.state.service
    return service


Shared = Annotated[Service, Depends(_service)]


async def health(service: Shared) -> HealthOut:
    """State of the service, its pipeline, its sensors and its readers; 200 as long as the service runs."""
    return service.health()


async def ready(service: Shared, response: Response) -> messages.ReadyOut:
    """Whether estimates are current: 200, or 503 with the reasons. Needs no token."""
    if not service.ready:
        response.status_code = 503
    return messages.ReadyOut(
        ready=service.ready, status=service.runner.status, reasons=list(service.runner.reasons)
    )


async def metrics(service: Shared) -> Response:
    """All counters, ages and times in Prometheus' text format."""
    return Response(service.metrics.text(), media_type=CONTENT_TYPE)


async def robot(service: Shared) -> RobotOut:
    """The arm: links with mass and surface, joints with limits."""
    arm = service.scene.robot
    return RobotOut(
        name=arm.name,
        mass=arm.mass,
        links=[
            messages.LinkOut(
                name=link.name,
                mass=link.inertia.mass,
                com=link.inertia.com.tolist(),
                primitives=[primitive.model_dump(mode="json") for primitive in link.primitives],
            )
            for link in arm.links
        ],
        joints=[
            messages.JointOut(
                name=joint.name,
                position_limits=joint.position_limits,
                velocity_limit=joint.velocity_limit,
                torque_limit=joint.torque_limit,
            )
            for joint in arm.joints
        ],
    )


async def scene(service: Shared) -> SceneOut:
    """The arm in its place: mounting, tool, sensors and their noise."""
    here = service.scene
    return SceneOut(
        links=list(here.link_names),
        gravity_base=here.gravity_base.tolist(),
        scene=here.model_dump(mode="json"),
    )


async def contacts(service: Shared) -> Response:
    """The latest estimate. 503 with the reason while there is none that is current."""
    if not service.runner.current or service.hub.last is None:
        raise HTTPException(503, f"no current estimate: {service.runner.message}")
    return Response(service.hub.last, media_type="application/json")


async def locate(service: Shared, request: LocateIn) -> Response:
    """Locate the contact behind one static sample, or behind each of many (`{"samples": [...]}`).

    Needs no robot: samples come with the request. One sample is answered by an `EstimateOut`, many by
    `EstimatesOut`.
    """
    many = isinstance(request, messages.LocateManyIn)
    samples: Sequence[messages.SampleIn] = (
        request.samples if isinstance(request, messages.LocateManyIn) else [request]
    )
    for index, sample in enumerate(samples):
        _check(sample, service.scene, f"samples[{index}]." if many else "")
    try:
        encoded = await service.locate(samples, request.external)
    except LocateError as error:
        raise HTTPException(503, str(error), {"Retry-After": "1"}) from None
    body = b'{"estimates":[' + b",".join(encoded) + b"]}" if many else encoded[0]
    return Response(body, media_type="application/json")


async def stream(
    websocket: WebSocket,
    service: Shared,
    every: Annotated[int, Query(ge=1, le=1_000_000)] = 1,
    rate: Annotated[float | None, Query(ge=0.001, le=1e6, allow_inf_nan=False)] = None,
) -> None:
    """One estimate per sample as JSON text, thinned out as requested."""
    await websocket.accept()
    with service.hub.subscribe(every, 0.0 if rate is None else 1.0 / rate) as reader:
        sending = asyncio.create_task(_send(websocket, reader))
        leaving = asyncio.create_task(_until_gone(websocket))
        try:
            await asyncio.wait({sending, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            sending.cancel()
            leaving.cancel()
            await asyncio.gather(sending, leaving, return_exceptions=True)


async def _send(websocket: WebSocket, reader: Reader) -> None:
    while True:
        message = await reader.take()
        if lost := reader.take_lost():
            await websocket.send_text(f'{{"lost":{lost}}}')
        await websocket.send_text(message.decode())


async def _until_gone(websocket: WebSocket) -> None:
    """Receive and ignore the reader's messages until it leaves."""
    with contextlib.suppress(WebSocketDisconnect):
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return


def _check(sample: messages.SampleIn, here: Scene, prefix: str) -> None:
    n = len(here.robot.joints)
    for name in ("q", "joint_torque"):
        value = getattr(sample, name)
        if value is not None and len(value) != n:
            raise FieldRefusedError(
                prefix + name, f"expected {n} numbers, one per joint of {here.robot.name}, got {len(value)}"
            )
    if sample.base_wrench is None and sample.joint_torque is None:
        raise FieldRefusedError(
            prefix + "base_wrench", "expected base_wrench or joint_torque or both, got neither"
        )
    for name in ("base_wrench", "joint_torque", "wrist_wrench"):
        if getattr(sample, name) is not None and getattr(here, name) is None:
            raise FieldRefusedError(
                prefix + name, f"the scene has no such sensor; leave it out or add {name} to the scene"
            )


def create_app(
    settings: Settings | None = None,
    source: Callable[[Scene], Source] | None = None,
    on_loading: OnLoading | None = None,
) -> FastAPI:
    """The application.

    Args:
        settings: How to run; without it, from the environment.
        source: Makes the source of samples in the pipeline's process, must be picklable; without it, from
            `settings`.
        on_loading: Called with the progress while kernels are compiled, from any thread.

    Raises:
        SettingsError: A setting cannot be used.
    """
    settings = settings or Settings.from_environment()
    service = Service(settings, source, on_loading)

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with service.running():
            yield

    app = FastAPIOffline(
        title="contactsense",
        version=version("contactsense"),
        description=DESCRIPTION,
        lifespan=lifespan,
        static_url="/docs/assets",
        redoc_url=None,
    )
    app.state.service = service
    refused: dict[int | str, dict[str, Any]] = {
        400: {"model": ErrorOut, "description": "The body is not text in UTF-8."},
        408: {"model": ErrorOut, "description": "The body did not arrive in time."},
        413: {"model": ErrorOut, "description": "The body is too large."},
        422: {"model": ErrorOut, "description": "The request cannot be used: field and reason."},
        503: {"model": ErrorOut, "description": "Too many requests wait already: try again later."},
    }
    stale: dict[int | str, dict[str, Any]] = {
        503: {"model": ErrorOut, "description": "There is no current estimate, with the reason."}
    }
    for status, description in COMMON_REFUSALS.items():
        app.router.responses[status] = {"model": ErrorOut, "description": description}
    app.get("/v1/ready", responses={503: {"model": messages.ReadyOut, "description": "It does not."}})(ready)
    app.get("/metrics", response_class=PlainTextResponse)(metrics)
    app.get("/v1/health")(health)
    app.get("/v1/robot")(robot)
    app.get("/v1/scene")(scene)
    app.get("/v1/contacts", response_model=EstimateOut, responses=stale)(contacts)
    app.post("/v1/locate", response_model=EstimateOut | EstimatesOut, responses=refused)(locate)
    app.websocket("/v1/stream")(stream)
    app.include_router(events.router)
    app.include_router(reactions.router)
    app.include_router(clips.router)
    app.include_router(track.router)
    app.include_router(xmlrpc.router)
    errors.install(app)
    app.add_middleware(Limits, limits=service.limits, refused=service.refused)
    app.add_middleware(Access, rules=settings.access_rules())
    return app
