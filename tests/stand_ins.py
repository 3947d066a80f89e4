"""What stands in for a fit where the command line is tested."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warp_cloth.scene import Scene


@dataclass(frozen=True)
class Step:
    """What a fit tells of its progress (warp_cloth.fitting.fit.Progress)."""

    stage: str
    iteration: int = 0
    iteration_limit: int = 100
    residual: float | None = None
    rest_error_mm: float | None = None
    iterations_per_second: float | None = None
    tolerance_mm: float | None = None


@dataclass
class StandIn:
    """Takes the place of warp_cloth.fitting.fit: remembers how it was called, writes one file."""

    worn: bool = True
    error: BaseException | None = None
    calls: list[dict[str, Any]] = field(default_factory=list)

    def fit(self, scene: Scene, **options: Any) -> StandIn:
        self.calls.append({"scene": scene, **options})
        options["progress"](Step("load"))
        if self.error:
            raise self.error
        options["progress"](Step("relax", 50, 100, 0.02, 1.5, 800.0))
        return self

    @property
    def report(self) -> dict[str, Any]:
        return {"status": "at_rest", "worn": self.worn, "message": "All forces balance.", "rest_error_mm": 0.4}

    def save(self, directory: Path, *, colour: str, formats: tuple[str, ...]) -> list[Path]:
        path = Path(directory) / "report.json"
        path.write_text("{}")
        return [path]
