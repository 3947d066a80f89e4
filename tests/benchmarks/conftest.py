"""Benchmarks as lines ``name value``, for people and programs alike."""

from __future__ import annotations

from typing import Any


def pytest_terminal_summary(terminalreporter: Any, config: Any) -> None:
    session = getattr(config, "_benchmarksession", None)
    for benchmark in getattr(session, "benchmarks", []):
        name = benchmark.name.removeprefix("test_").replace(", ", "+").replace(" ", "_")
        for metric, value in benchmark.extra_info.items():
            terminalreporter.write_line(f"{name}.{metric} {value:.4g}")
