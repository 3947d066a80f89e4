"""What a service accepts, and how long it takes at most."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits of a service; beyond them requests are refused."""

    request_bytes: int = 32_000_000  # of a request; a scan of 300,000 triangles as .obj, in base64
    queue: int = 256  # requests that wait or are fitted
    seconds: float = 120.0  # from a request's last byte to its answer
    upload_seconds: float = 30.0  # for a request's bytes to arrive
    held_bytes: int = 1_000_000_000  # of all requests that have not been answered, together
    together: int = 64  # requests that a GPU fits in one launch
