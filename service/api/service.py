"""State shared by all requests: scene, pipeline, hub, journal and reactions, started and stopped together."""

import asyncio
import contextlib
import logging
import signal
import threading
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Annotated, Any

from fastapi import Depends
from starlette.requests import HTTPConnection

from contactsense import Scene
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.service.api import messages
from contactsense.service.api.clip_recording import check_folder, clip_listeners
from contactsense.service.api.clips import Clips
from contactsense.service.api.http.connections import ConnectionLimits
from contactsense.service.api.http.limits import RequestLimits
from contactsense.service.api.messages import HealthOut
from contactsense.service.api.metrics import Metrics
from contactsense.service.api.sample_source import check_robot_address, open_source
from contactsense.service.api.scene_file import load_scene
from contactsense.service.api.settings import Settings, SettingsError
from contactsense.service.api.tracks import Tracks
from contactsense.service.controllers.robot_program import NewestEstimate, RobotProgramMethods
from contactsense.service.controllers.robot_program_servers import RobotProgramServers
from contactsense.service.events.journal import Journal, JournalError, JournalSettings
from contactsense.service.events.model import ContactEvent
from contactsense.service.events.open_contacts import OpenContacts
from contactsense.service.live.hub import Hub
from contactsense.service.live.loading import OnLoading
from contactsense.service.live.locate_process import LocateError, LocateProcess, StaticSample
from contactsense.service.live.pipeline_process import ListenerFactory, Source, utc_now
from contactsense.service.live.supervisor import Runner
from contactsense.service.reactions.health import failure
from contactsense.service.reactions.reaction_store import ReactionStore
from contactsense.service.reactions.rules import ReactionRules, RulesError
from contactsense.service.reactions.state import Reactions
from contactsense.service.reactions.webhook_delivery import WebhookDelivery

log = logging.getLogger("contactsense")
_VERSION = version("contactsense")
"""Found once: it is read from a file, and each look at a changed folder of packages would stay in memory."""


class Service:
    """State shared by all requests."""

    def __init__(
        self,
        settings: Settings,
        source: Callable[[Scene], Source] | None,
        on_loading: OnLoading | None = None,
    ) -> None:
        self.scene = load_scene(settings)
        self.plausible = PlausibleLimits(self.scene)
        """Limits of the measurements in requests."""
        self.hub = Hub(settings.queue)
        self._settings = settings
        if settings.events.path is not None:
            _check_journal(settings.events)
        check_folder(settings)
        self.clips = Clips(settings.recording, lambda command: self.runner.send(command))
        self.journal: Journal
        """Events; open while the service runs."""
        self._contacts: OpenContacts
        self.webhooks: WebhookDelivery
        """Waiting webhooks; delivered while the service runs."""
        self.reaction_store: ReactionStore
        """Latched collisions and a lowered slider in the journal's file; open while the service runs."""
        rules = self._load_rules(self.scene)
        check_robot_address(settings, rules)
        try:
            self.reactions = Reactions(
                rules,
                settings.robot_host,
                lambda command: self.runner.send(command),
                settings.robot_port,
                kept=settings.events.path is not None,
            )
        except RulesError as error:
            raise SettingsError(str(error)) from None
        self._given_source = source
        self.runner = Runner(
            self.scene,
            source or open_source(settings, self.scene),
            self.hub.publish,
            self._handle_report,
            self._listeners(),
            on_loading,
        )
        self.tracks = Tracks(settings.controllers, self.hub)
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
        """Number of refused requests beyond the limits, by status."""
        self.reloaded: messages.ReloadHealth | None = None
        self.metrics = Metrics(self.health)
        self._locate = LocateProcess(self.scene)
        self._reloading = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Run the service: start the pipeline, load the kernels, and handle SIGHUP."""
        loop = asyncio.get_running_loop()
        self.journal = Journal(self._settings.events)
        self._contacts = OpenContacts(self.journal)
        self._end_contacts("the service")
        self.webhooks = WebhookDelivery(self.journal, self.reactions.webhooks, self._note_webhook)
        self.webhooks.start()
        self.reaction_store = ReactionStore(self.journal)
        self.reactions.on_latched = self.reaction_store.save
        self.reactions.on_lowered = self.reaction_store.save_lowered
        self.reactions.restore(self.reaction_store.load(), self.reaction_store.load_lowered())
        self.runner.others = self._troubles
        self.runner.on_end = self._note_end_of_pipeline
        loading = loop.create_task(self._load())
        self.runner.start()
        reloads: set[asyncio.Task[None]] = set()

        def hang_up() -> None:
            task = loop.create_task(self.reload())
            reloads.add(task)
            task.add_done_callback(reloads.discard)

        handles_sighup = threading.current_thread() is threading.main_thread() and hasattr(signal, "SIGHUP")
        if handles_sighup:
            loop.add_signal_handler(signal.SIGHUP, hang_up)
        try:
            await self.ports.start()
            yield
        finally:
            if handles_sighup:
                loop.remove_signal_handler(signal.SIGHUP)
            loading.cancel()
            self._locate.stop()
            await asyncio.wait([loading, *reloads])
            await self.ports.stop()
            await self.runner.stop()
            self.reactions.note_end()
            self._end_contacts("the service")
            await self.webhooks.stop()
            await asyncio.to_thread(self.reaction_store.close)
            self.journal.close()

    def _handle_report(self, report: dict[str, Any]) -> None:
        """Process a report of the pipeline's process."""
        kind = report["type"]
        if kind == "event":
            event = ContactEvent.model_validate(report["event"])
            self.record(event if event.time else event.model_copy(update={"time": utc_now()}))
        elif kind == "reactions":
            self.reactions.handle_report(report)
        elif kind == "webhook":
            self.webhooks.enqueue(report["action"], report["decision"])
        elif kind == "stream":
            self.tracks.begin_stream()
        else:
            self.clips.handle_report(report)

    def _troubles(self) -> list[str]:
        """Problems outside the pipeline: current estimates alone do not make the service healthy."""
        found = [failure(name, action) for name, action in self.reactions.actions.items() if action.error]
        if self.clips.recording.trouble:
            found.append(self.clips.recording.trouble)
        if self.journal.error:
            found.append(self.journal.error)
        if self.webhooks.error:
            found.append(self.webhooks.error)
        return found

    def _note_webhook(self, name: str, ok: bool, reason: str, decision: Mapping[str, Any]) -> None:
        event = self.reactions.note_webhook(name, ok, reason, decision)
        self.record(event.model_copy(update={"time": utc_now()}))

    def record(self, event: ContactEvent) -> None:
        """Put an event into the journal and into the stream."""
        self._contacts.note(event)
        self.hub.add_event(self.journal.append(event).model_dump_json().encode())
        if event.kind == "collision" and self.clips.settings.folder is not None:
            self.clips.order_of_collision(event.link)

    def _end_contacts(self, who: str) -> None:
        """Release the open contacts, because `who` has ended: the next process numbers its own from 1 on."""
        for event in self._contacts.end(who, utc_now()):
            self.record(event)

    def _note_end_of_pipeline(self) -> None:
        self.clips.note_end()
        self._end_contacts("the pipeline's process")

    def _load_rules(self, scene: Scene) -> ReactionRules | None:
        """Load the rules of the scene.

        Raises:
            SettingsError: The rules file cannot be used.
        """
        try:
            return self._settings.reactions.load(scene, self._settings.scene)
        except RulesError as error:
            raise SettingsError(str(error)) from None

    def _listeners(self) -> tuple[ListenerFactory, ...]:
        factory = self.reactions.factory
        # Reactions come first: they are urgent, recordings are not.
        return (*(() if factory is None else (factory,)), *clip_listeners(self._settings))

    async def _load(self) -> None:
        await self.runner.loaded.wait()  # two processes compiling the same kernels would be slower
        with contextlib.suppress(LocateError, OSError):  # it is tried again at the first request
            await self._locate.start()

    async def reload(self) -> None:
        """Reload the scene and the rules; if they are not valid, nothing changes."""
        async with self._reloading:  # one at a time: each stops what runs, and starts it anew
            await self._reload()

    async def _reload(self) -> None:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        try:
            scene = await asyncio.to_thread(load_scene, self._settings)
            source = self._given_source or await asyncio.to_thread(open_source, self._settings, scene)
            rules = await asyncio.to_thread(self._load_rules, scene)
            plausible = await asyncio.to_thread(PlausibleLimits, scene)
            self.reactions.replace(rules)
        except (SettingsError, RulesError) as error:
            log.error("reload: nothing has changed: %s", error)
            self.reloaded = messages.ReloadHealth(time=at, ok=False, message=str(error))
            return
        self.scene, self.plausible = scene, plausible
        await self.webhooks.replace(self.reactions.webhooks)
        self.runner.restart(scene, source, self._listeners())
        self._locate.restart(scene)
        restarted = "" if source is None else "; the pipeline is being restarted with it"
        log.info("reload: the new scene is in use%s", restarted)
        self.reloaded = messages.ReloadHealth(time=at, ok=True, message="")

    async def locate(
        self, samples: Sequence[messages.SampleIn], external: bool, contacts: int
    ) -> list[bytes]:
        """Return estimates as JSON for static samples.

        Raises:
            LocateError: The request cannot be answered at present; the text gives the reason.
        """
        plain = [
            StaticSample(s.q, s.base_wrench, s.joint_torque, s.wrist_wrench, s.link_wrenches) for s in samples
        ]
        return await self._locate.locate(plain, external, contacts)

    @property
    def ready(self) -> bool:
        """Whether the service is ready: estimates are current, or no robot is configured."""
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
                "message_errors": runner.message_errors.count,
                "last_message_error": runner.message_errors.last,
            }
        )
        return HealthOut(
            status=runner.status,
            message=runner.message,
            loading=runner.loading.share,
            loading_left=runner.loading.left,
            reasons=list(runner.reasons),
            ready=self.ready,
            since=runner.since.isoformat(timespec="milliseconds"),
            uptime=time.monotonic() - self.began,
            version=_VERSION,
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


def _check_journal(settings: JournalSettings) -> None:
    """Read what the service reads when it starts.

    Raises:
        SettingsError: The file cannot be used.
    """
    try:
        with Journal(settings) as journal:
            OpenContacts(journal)
            with contextlib.closing(ReactionStore(journal)) as store:
                store.load()
                store.load_lowered()
    except JournalError as error:
        raise SettingsError(str(error)) from None


def _service(connection: HTTPConnection) -> Service:
    service: Service = connection.app.state.service
    return service


Shared = Annotated[Service, Depends(_service)]
