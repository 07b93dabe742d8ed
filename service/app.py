"""The service over HTTP and WebSocket: a table of routes around the runner, the hub and one localizer.

`create_app` is a factory: `uvicorn --factory service.app:create_app` takes its settings from the environment.
"""

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from importlib.metadata import version
from typing import Annotated, Any

import numpy as np
from fastapi import Depends, FastAPI, Query, Response, WebSocket, WebSocketDisconnect
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from contactsense import Estimate, Localizer, Scene
from service import errors, messages
from service.errors import FieldRefusedError
from service.hub import Hub, Reader
from service.messages import ErrorOut, EstimateOut, EstimatesOut, HealthOut, LocateIn, RobotOut, SceneOut
from service.runner import Runner
from service.settings import Settings
from service.worker import Source

DESCRIPTION = """
Where is a robot arm being touched? Contact location from a force/torque sensor under the base and joint
torques.

**Frames.** Base frame: the robot controller's own. Link frames: as in the robot's description; each link's
frame turns with its joint. **Wrenches** are force then moment, moments about the base origin. **Units** are
SI: m, rad, s, N, Nm.

**Stream.** `WS /v1/stream` sends one `EstimateOut` per sample as JSON text. `?every=10` sends one in ten,
`?rate=30` at most so many a second. A reader that is too slow loses the oldest and is told how many, by
`{"lost": n}`.

This software is not a safety function.
"""


class Service:
    """What the requests share."""

    def __init__(self, settings: Settings, source: Callable[[Scene], Source] | None) -> None:
        self.scene = settings.load_scene()
        self.hub = Hub(settings.queue)
        self.runner = Runner(self.scene, source or settings.open_source(self.scene), self.hub.publish)
        self.began = time.monotonic()
        self._localizer: asyncio.Task[Localizer] | None = None
        self._one_at_a_time = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Pipeline running, kernels on their way."""
        self._localizer = asyncio.create_task(self._load())
        self.runner.start()
        try:
            yield
        finally:
            await self.runner.stop()
            self._localizer.cancel()
            await asyncio.wait([self._localizer])

    async def _load(self) -> Localizer:
        await self.runner.loaded.wait()  # two processes that compile the same kernels would only be slower
        loop = asyncio.get_running_loop()
        loaded: asyncio.Future[Localizer] = loop.create_future()

        def tell(result: Localizer | Exception) -> None:
            if loaded.done():
                return
            if isinstance(result, Exception):
                loaded.set_exception(result)
            else:
                loaded.set_result(result)

        def load() -> None:
            result: Localizer | Exception
            try:
                result = Localizer(self.scene)
            except Exception as error:
                result = error
            with contextlib.suppress(RuntimeError):  # the loop has been closed meanwhile
                loop.call_soon_threadsafe(tell, result)

        # A daemon: a service that is told to end does not wait for the compiler.
        threading.Thread(target=load, name="loading kernels", daemon=True).start()
        return await loaded

    async def locate(self, samples: Sequence[messages.SampleIn], external: bool) -> list[Estimate]:
        """Locate static samples; a localizer's working arrays are not for two at a time."""
        assert self._localizer is not None
        localizer = await asyncio.shield(self._localizer)

        def work() -> list[Estimate]:
            return [
                localizer.locate(
                    np.array(sample.q),
                    base_wrench=None if sample.base_wrench is None else np.array(sample.base_wrench),
                    joint_torque=None if sample.joint_torque is None else np.array(sample.joint_torque),
                    wrist_wrench=None if sample.wrist_wrench is None else np.array(sample.wrist_wrench),
                    external=external,
                )
                for sample in samples
            ]

        async with self._one_at_a_time:
            return await asyncio.to_thread(work)

    def health(self) -> HealthOut:
        """How everything fares."""
        runner = self.runner
        return HealthOut(
            status=runner.status,
            message=runner.message,
            since=runner.since.isoformat(timespec="milliseconds"),
            uptime=time.monotonic() - self.began,
            version=version("contactsense"),
            source=runner.source,
            pipeline=runner.pipeline,
            stream=messages.StreamHealth(readers=self.hub.readers, lost=self.hub.lost),
        )


def _service(connection: HTTPConnection) -> Service:
    service: Service = connection.app.state.service
    return service


Shared = Annotated[Service, Depends(_service)]


async def health(service: Shared) -> HealthOut:
    """How the service, its pipeline, its sensors and its readers fare; 200 as long as the service lives."""
    return service.health()


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
    """The latest estimate. 503 while there is none that is current; the reason says why."""
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
    estimates = await service.locate(samples, request.external)
    encoded = [messages.estimate_json(estimate) for estimate in estimates]
    body = b'{"estimates":[' + b",".join(encoded) + b"]}" if many else encoded[0]
    return Response(body, media_type="application/json")


async def stream(
    websocket: WebSocket,
    service: Shared,
    every: Annotated[int, Query(ge=1)] = 1,
    rate: Annotated[float | None, Query(gt=0.0, allow_inf_nan=False)] = None,
) -> None:
    """One estimate per sample as JSON text, thinned out as asked for."""
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
    """Take what the reader says, which is nothing of interest, until it leaves."""
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


def create_app(settings: Settings | None = None, source: Callable[[Scene], Source] | None = None) -> FastAPI:
    """The application.

    Args:
        settings: How to run; without it, from the environment.
        source: Makes the source of samples in the pipeline's process, must be picklable; without it, from
            `settings`.

    Raises:
        SettingsError: A setting cannot be used.
    """
    settings = settings or Settings.from_environment()
    service = Service(settings, source)

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with service.running():
            yield

    app = FastAPI(
        title="contactsense", version=version("contactsense"), description=DESCRIPTION, lifespan=lifespan
    )
    app.state.service = service
    refused: dict[int | str, dict[str, Any]] = {
        422: {"model": ErrorOut, "description": "The request cannot be used: field and reason."}
    }
    stale: dict[int | str, dict[str, Any]] = {
        503: {"model": ErrorOut, "description": "There is no current estimate: the reason says why."}
    }
    app.get("/v1/health")(health)
    app.get("/v1/robot")(robot)
    app.get("/v1/scene")(scene)
    app.get("/v1/contacts", response_model=EstimateOut, responses=stale)(contacts)
    app.post("/v1/locate", response_model=EstimateOut | EstimatesOut, responses=refused)(locate)
    app.websocket("/v1/stream")(stream)
    errors.install(app)
    return app
