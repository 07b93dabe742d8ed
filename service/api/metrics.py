"""Metrics for Prometheus: rates, ages, losses, times, connections, reactions. Computed at each request."""

from collections.abc import Callable, Iterator

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from contactsense.service.api.messages import HealthOut
from contactsense.service.live.step_times import BOUNDS

CONTENT_TYPE = CONTENT_TYPE_LATEST
STATUSES = ("ok", "degraded", "starting", "waiting", "failing", "idle")


class ServiceCollector(Collector):
    """The service's health as metrics.

    Args:
        health: Returns the health.
    """

    def __init__(self, health: Callable[[], HealthOut]) -> None:
        self._health = health

    def collect(self) -> Iterator[Metric]:
        """All metrics with their present values."""
        health = self._health()
        status = GaugeMetricFamily("contactsense_status", "1 for the present status.", labels=["status"])
        for name in STATUSES:
            status.add_metric([name], float(health.status == name))
        yield status
        yield from self._gauges(health)
        yield from self._counters(health)
        yield from _reactions(health)
        yield from _steps(health)

    @staticmethod
    def _gauges(health: HealthOut) -> Iterator[Metric]:
        source, pipeline = health.source, health.pipeline
        for name, help_text, value in (
            ("uptime_seconds", "Time since the service began.", health.uptime),
            ("ready", "Whether estimates are current.", float(health.ready)),
            ("collisions_latched", "Collisions not acknowledged.", health.reactions.latched),
            ("samples_per_second", "Samples over the last second.", source.rate),
            ("sample_age_seconds", "Time since the latest sample.", source.age),
            ("estimate_age_seconds", "Time since the latest estimate arrived.", pipeline.estimate_age),
            ("report_age_seconds", "Time since the pipeline's latest message.", pipeline.report_age),
            (
                "handover_seconds",
                "Way of the latest report to the web process.",
                pipeline.handover,
            ),
            ("event_loop_lag_seconds", "By how much the web process was late.", health.lag),
            ("connections", "Open connections, WebSockets included.", health.clients.connections),
            ("stream_readers", "Open streams.", health.stream.readers),
        ):
            if value is not None:
                yield GaugeMetricFamily(f"contactsense_{name}", help_text, value)

    @staticmethod
    def _counters(health: HealthOut) -> Iterator[Metric]:
        source, pipeline, clients = health.source, health.pipeline, health.clients
        for name, help_text, count in (
            ("pipeline_restarts", "How often the pipeline was restarted.", pipeline.restarts),
            ("estimates", "Estimates that arrived.", pipeline.estimates),
            ("estimates_dropped", "Estimates that could not be handed over.", pipeline.dropped),
            ("stream_lost", "Estimates lost by slow readers.", health.stream.lost),
            ("samples_without_wrench", "Samples without the base sensor's reading.", source.without_wrench),
            ("samples_unusable", "Samples that were left out.", source.unusable),
            ("connections_refused", "Connections refused because there were too many.", clients.refused),
            ("connections_late", "Connections closed because of a slow or large head.", clients.late),
            ("connections_dropped", "Connections closed as nothing was taken.", clients.dropped),
        ):
            yield CounterMetricFamily(f"contactsense_{name}", help_text, count)
        requests = CounterMetricFamily(
            "contactsense_requests_refused", "Requests beyond a limit.", labels=["status"]
        )
        for status, count in clients.beyond_limits.items():
            requests.add_metric([status], count)
        yield requests
        received = CounterMetricFamily("contactsense_received", "Readings received.", labels=["sensor"])
        lost = CounterMetricFamily("contactsense_lost", "Readings lost on their way.", labels=["sensor"])
        within = ((f"link_wrenches.{name}", sensor) for name, sensor in source.link_wrenches.items())
        for name, sensor in (("robot", source.robot), ("base_wrench", source.base_wrench), *within):
            if sensor is not None:
                received.add_metric([name], sensor.received)
                lost.add_metric([name], sensor.lost)
        yield received
        yield lost


def _reactions(health: HealthOut) -> Iterator[Metric]:
    started = CounterMetricFamily(
        "contactsense_actions_started", "Starts of an action of the reactions.", labels=["action"]
    )
    failed = CounterMetricFamily(
        "contactsense_actions_failed", "Failures of an action of the reactions.", labels=["action"]
    )
    for name, action in health.reactions.actions.items():
        started.add_metric([name], action.started)
        failed.add_metric([name], action.failed)
    yield started
    yield failed


def _steps(health: HealthOut) -> Iterator[Metric]:
    counts, total = health.pipeline.step_counts, 0
    if not counts:
        return
    buckets = []
    for bound, count in zip((*BOUNDS, float("inf")), counts, strict=True):
        total += count
        buckets.append(("+Inf" if bound == float("inf") else f"{bound:g}", float(total)))
    family = HistogramMetricFamily("contactsense_step_seconds", "Time of the localizer's step.")
    family.add_metric([], buckets, sum_value=health.pipeline.step_sum)
    yield family


class Metrics:
    """The registry of one service; other modules may register their own collectors."""

    def __init__(self, health: Callable[[], HealthOut]) -> None:
        self.registry = CollectorRegistry()
        """Registry for further collectors."""
        self.registry.register(ServiceCollector(health))

    def text(self) -> bytes:
        """All metrics in Prometheus' text format."""
        return generate_latest(self.registry)
