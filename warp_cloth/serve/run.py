"""Runs a service until it is interrupted: its queue, its scratch folder, its HTTP server."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable, Iterator, Sequence

from warp_cloth.base.errors import InputError
from warp_cloth.batch.gpu_sharing import shared_gpus
from warp_cloth.batch.processes import start_forkserver
from warp_cloth.batch.run import worker_devices
from warp_cloth.serve.catalogue import read_catalogue
from warp_cloth.serve.limits import Limits
from warp_cloth.serve.scratch import scratch_folder

BACKLOG = 1024  # connections that wait to be accepted


def serve(
    products: Sequence[str],
    *,
    host: str,
    port: int,
    device: str | None = None,
    workers: int | None = None,
    limits: Limits | None = None,
    show: Callable[[str], None] = print,
) -> None:
    """Serves products over HTTP until it is interrupted.

    Args:
        products: shipped scenes, scene files, and job files with a [product].
        host: address to serve on.
        port: port; 0: any that is free.
        device: "cpu", "cuda" (all GPUs) or "cuda:N"; None: all GPUs, or the CPU.
        workers: processes; None: as for a batch.
        limits: what is accepted.
        show: called with the service's address once it serves.

    Raises:
        InputError: a product, the device or the address cannot be used, or workers cannot start.
    """
    os.environ["WARP_CLOTH_CACHE"] = "off"  # of bodies and their fields, on disk; workers inherit it
    start_forkserver(device)  # while this process imports
    limits = limits or Limits()
    catalogue = read_catalogue(products)
    on_gpus = shared_gpus(device != "cpu" and workers != 1)
    with _listening(host, port) as listener, scratch_folder() as scratch, on_gpus as sharing:
        devices = worker_devices(device, workers, sharing)
        import uvicorn

        from warp_cloth.serve.app import Service, make_app
        from warp_cloth.serve.dispatcher import Dispatcher

        dispatcher = Dispatcher(devices, limits, scratch, sharing)
        dispatcher.start()
        try:
            service = Service(catalogue, dispatcher, limits, scratch, ", ".join(dict.fromkeys(devices)))

            class Server(uvicorn.Server):
                async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
                    """Refuses what waits first: uvicorn waits until every request has been answered."""
                    await service.end()
                    await super().shutdown(sockets)

            address = f"http://{f'[{host}]' if ':' in host else host}:{listener.getsockname()[1]}"
            show(f"serving {', '.join(catalogue)} on {address}; {address}/docs explains it; Ctrl-C ends it")
            config = uvicorn.Config(make_app(service), log_level="warning", access_log=False, server_header=False)
            Server(config).run([listener])
        finally:
            dispatcher.close()  # interrupted before uvicorn ran, workers would be waited for without end


@contextlib.contextmanager
def _listening(host: str, port: int) -> Iterator[socket.socket]:
    """A socket that listens there; InputError where it cannot."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
            listener.listen(BACKLOG)
        except (OSError, OverflowError) as error:
            problem = f"cannot serve there ({getattr(error, 'strerror', None) or error})"
            raise InputError(f"{host}:{port}", problem, "choose another --port, or --host 127.0.0.1") from None
        yield listener
