"""Counters of a server about itself, in Prometheus' text format."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.errors import AdapterError, install_extra

_SECONDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
_SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128)


class Metrics:
    """Counts queries, errors and durations.

    Raises:
        AdapterError: The library is not installed.
    """

    def __init__(self) -> None:
        try:
            import prometheus_client
        except ImportError:
            raise AdapterError(
                f"Metrics need the package prometheus-client: {install_extra('metrics')}."
            ) from None
        self._library: Any = prometheus_client
        self._registry = prometheus_client.CollectorRegistry()
        prometheus_client.ProcessCollector(registry=self._registry)

        def histogram(name: str, text: str, buckets: tuple[float, ...] = _SECONDS) -> Any:
            return prometheus_client.Histogram(
                f"libero_max_{name}", text, buckets=buckets, registry=self._registry
            )

        self._latency = histogram("latency_seconds", "From the arrival of a query to its answer.")
        self._queue = histogram("queue_seconds", "From the arrival of a query until the policy is asked.")
        self._policy = histogram("policy_seconds", "One call of the policy, for a batch or a query alone.")
        self._batch = histogram("batch_size", "Queries answered together.", _SIZES)
        self._errors = prometheus_client.Counter(
            "libero_max_errors", "Queries that were not answered.", ["error"], registry=self._registry
        )
        self._clients = prometheus_client.Gauge(
            "libero_max_clients", "Clients connected now.", registry=self._registry
        )

    def batch(self, queued_s: list[float], policy_s: float) -> None:
        """Count a batch: the time that each of its queries waited, and the time of the policy, s."""
        self._batch.observe(len(queued_s))
        self._policy.observe(policy_s)
        for seconds in queued_s:
            self._queue.observe(seconds)
            self._latency.observe(seconds + policy_s)

    def error(self, error: BaseException) -> None:
        """Count a query that got an error instead of an answer."""
        self._errors.labels(type(error).__name__).inc()

    def clients(self, count: int) -> None:
        """Set the number of clients."""
        self._clients.set(count)

    def text(self) -> tuple[str, str]:
        """Return everything that was counted, and the content type."""
        content: bytes = self._library.generate_latest(self._registry)
        return content.decode(), str(self._library.CONTENT_TYPE_LATEST)
