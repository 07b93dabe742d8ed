"""The application: routes, limits and access around one `Service`.

`create_app` is a factory: `uvicorn --factory contactsense.service.api.app:create_app` takes its settings from
the environment.
"""

import contextlib
from collections.abc import AsyncIterator, Callable
from importlib.metadata import version
from typing import Any

from fastapi import Depends, FastAPI
from fastapi.responses import RedirectResponse
from fastapi_offline import FastAPIOffline

from contactsense import Scene
from contactsense.service.api.exposure import access_rules
from contactsense.service.api.http import errors
from contactsense.service.api.http.access import OPEN_PATHS, Access
from contactsense.service.api.http.ending import Ending
from contactsense.service.api.http.head import Head
from contactsense.service.api.http.known_parameters import refuse_unknown_parameters
from contactsense.service.api.http.limits import Limits
from contactsense.service.api.http.unknown_path import UnknownPath
from contactsense.service.api.routes import (
    clips,
    estimates,
    events,
    health,
    locate,
    reactions,
    robot,
    track,
    xmlrpc,
)
from contactsense.service.api.service import Service
from contactsense.service.api.settings import Settings
from contactsense.service.live.loading import OnLoading
from contactsense.service.live.pipeline_process import Source

DESCRIPTION = """
Where is a robot arm being touched? Contact location from a force/torque sensor under the base and joint
torques.

**Frames.** Base frame: the robot controller's own. Link frames: as in the robot's description; each link's
frame turns with its joint. **Wrenches** are force then moment, moments about the base origin. **Units** are
SI: m, rad, s, N, Nm.

**Stream.** `WS /v1/stream` sends one `EstimateOut` per sample as JSON text. `?every=10` sends one in ten,
`?rate=30` at most that many per second (0.001 at least). A reader that is too slow loses the oldest and
receives their number, `{"lost": n}`; one that takes nothing for 10 s is dropped.

**WebSocket routes.** OpenAPI has no place for them, hence this table.

| route | parameters | messages from the service | closes with |
| --- | --- | --- | --- |
| `WS /v1/stream` | `every` (1 to 1000000), `rate` [Hz] | `EstimateOut`, or `{"lost": n}` | 1008, 1012 |
| `WS /v1/events` | `since` (number of an event) | an event of `GET /v1/events`, or `ErrorOut` | 1008, 1012 |
| `WS /v1/track` | | an `EstimateOut` for each sample sent, or `ErrorOut` | 1000, 1008, 1011, 1012, 1013 |

Code 1008 follows an `ErrorOut` where a parameter is wrong or unknown. 1012: the service ends or is started
again; 1013: another connection must end first; 1011: the localizer's process has ended; 1000: nothing has
come for too long.

**Token.** Where the service has one, each request sends it as `Authorization: Bearer TOKEN`. A WebSocket
may send it instead as the subprotocols `contactsense, bearer.TOKEN`, as browsers can, or as `?token=TOKEN`.
`/`, `/v1/ready`, `/docs` and `/openapi.json` need none.

This software is not a safety function.
"""


ROUTERS = (
    (health, "state"),
    (robot, "arm"),
    (estimates, "live"),
    (locate, "locate"),
    (events, "live"),
    (reactions, "reactions"),
    (clips, "recordings"),
    (track, "live"),
    (xmlrpc, "robot programs"),
)
"""Modules with routes, and the group under which the description lists them."""
GROUPS = {
    "state": "Whether the service and its sensors work.",
    "arm": "What the service knows of the arm and its cell.",
    "live": "Contacts of the arm that the service reads.",
    "locate": "Contacts in samples that the request contains.",
    "reactions": "What contacts do to the robot.",
    "recordings": "Samples and estimates in files.",
    "robot programs": "For programs that run on the robot's controller.",
}
"""Groups of routes, in the order in which the description lists them."""


def create_app(
    settings: Settings | None = None,
    source: Callable[[Scene], Source] | None = None,
    on_loading: OnLoading | None = None,
) -> FastAPI:
    """Create the application.

    Args:
        settings: Settings of the service; None: from the environment.
        source: Creates the source of samples in the pipeline's process, must be picklable; None: from
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

    rules = access_rules(settings)
    app = FastAPIOffline(
        title="contactsense",
        version=version("contactsense"),
        description=DESCRIPTION,
        lifespan=lifespan,
        openapi_tags=[{"name": name, "description": text} for name, text in GROUPS.items()],
        static_url="/docs/assets",
        redoc_url=None,
    )
    if rules.token is not None:
        _describe_token(app)
    app.state.service = service
    app.router.responses.update(errors.COMMON_REFUSALS)
    app.add_api_route("/", _to_description, include_in_schema=False)
    for module, group in ROUTERS:
        app.include_router(module.router, tags=[group], dependencies=[Depends(refuse_unknown_parameters)])
    app.router.default = UnknownPath(app.routes)
    errors.install(app)
    app.add_middleware(Limits, limits=service.limits, refused=service.refused)
    app.add_middleware(Access, rules=rules)
    app.add_middleware(Ending)
    app.add_middleware(Head)
    return app


def _describe_token(app: FastAPI) -> None:
    """Describe the token, too, so that `/docs` asks for it and clients made from the description send it."""
    described = app.openapi

    def openapi() -> dict[str, Any]:
        found = described()
        found["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
        for path, operations in found["paths"].items():
            for operation in operations.values() if not path.startswith(OPEN_PATHS) else ():
                operation["security"] = [{"token": []}]
        return found

    app.openapi = openapi  # type: ignore[method-assign]


async def _to_description() -> RedirectResponse:
    """Lead whoever opens the address in a browser to the description; relative, for proxies that add a
    path."""
    return RedirectResponse("docs")
