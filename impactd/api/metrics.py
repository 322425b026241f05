"""Prometheus metrics of the daemon."""

from __future__ import annotations

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector
from starlette.types import Scope

from impactd.api.domain_metrics import DomainMetrics
from impactd.daemon import Daemon


class Metrics(Collector):
    """The metrics of one application."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._domain = DomainMetrics(daemon.archive)
        self._registry = CollectorRegistry()
        self._requests = Counter(
            "impactd_http_requests",
            "Answered requests.",
            ["method", "route", "status"],
            registry=self._registry,
        )
        self._seconds = Histogram(
            "impactd_http_request_seconds",
            "Time to the first byte of an answer. [s]",
            ["route"],
            registry=self._registry,
            buckets=(0.002, 0.01, 0.05, 0.1, 0.5, 2.0, 10.0),
        )
        self._registry.register(self)

    def observe(self, scope: Scope, status: int, seconds: float) -> None:
        """Count one answer; unknown paths are one route, so that nobody can flood the labels."""
        route = getattr(scope.get("route"), "path", "(none)")
        method = scope["method"] if scope["method"] in _METHODS else "OTHER"
        self._requests.labels(method, route, str(status)).inc()
        self._seconds.labels(route).observe(seconds)

    def collect(self) -> Iterator[Metric]:
        """Yield what is read at the time of the scrape.

        Yields
        ------
        Metric
            One per family.
        """
        status = self._daemon.status()
        archive = self._daemon.archive
        last_drop = archive.drops(limit=1)
        gauges = {
            "impactd_ready": ("1 when a drop would be started now.", float(status["ready"])),
            "impactd_last_drop_number": (
                "Number of the newest drop.",
                float(last_drop[0].number if last_drop else 0),
            ),
            "impactd_jobs_waiting": ("Fits that wait or run.", float(archive.jobs.waiting())),
            "impactd_free_bytes": ("Free space for shots. [byte]", float(archive.free_bytes())),
        }
        for name, (meaning, value) in gauges.items():
            yield GaugeMetricFamily(name, meaning, value=value)
        alive = GaugeMetricFamily("impactd_alive", "1 while the part answers.", labels=["part"])
        for part, answers in self._daemon.liveness().items():
            alive.add_metric([part], float(answers))
        yield alive
        state = GaugeMetricFamily("impactd_state", "The state the rig is in.", labels=["state"])
        state.add_metric([str(status["state"])], 1.0)
        yield state
        yield from self._domain.collect()

    def describe(self) -> list[Metric]:
        """Return nothing: the registry must not read the rig while it registers."""
        return []

    def render(self) -> tuple[bytes, str]:
        """Return the text of a scrape and its media type."""
        return generate_latest(self._registry), CONTENT_TYPE_LATEST


_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH"})
