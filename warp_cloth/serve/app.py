"""The service over HTTP: its paths, the limits of what comes in, and refusals of one line each."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.openapi.utils import get_openapi
from fastapi_offline import FastAPIOffline
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from warp_cloth.base.errors import InputError
from warp_cloth.base.version import package_version
from warp_cloth.serve.answering import Reply, refused
from warp_cloth.serve.catalogue import OfferedProduct
from warp_cloth.serve.dispatcher import Dispatcher, Waiting
from warp_cloth.serve.limits import Limits
from warp_cloth.serve.orders import Order, order_of, parsed
from warp_cloth.serve.schema import EXAMPLES, FitAnswer, Health, Product, Refusal, openapi_models

log = logging.getLogger(__name__)

JSON = "application/json"
RETRY_SECONDS = "5"  # what a refusal for lack of room advises
ABOUT = """How does a garment sit on a body? `POST /fit` takes a body (a mesh, or measures) and a product, fits every
size, and answers with verdicts, ease, a recommendation and, if wanted, fit maps and meshes. Each fit has the same bits
as `warp_cloth.fit`. Nothing of a body is kept after the answer."""
REFUSALS: dict[int | str, dict[str, Any]] = {
    400: {"model": Refusal, "description": "Not JSON."},
    408: {"model": Refusal, "description": "The request did not arrive in time."},
    413: {"model": Refusal, "description": "The request is too large."},
    415: {"model": Refusal, "description": "The request is not of type application/json."},
    422: {"model": Refusal, "description": "The body or the product cannot be used."},
    503: {"model": Refusal, "description": "The queue is full, or a worker died twice: ask again later."},
    504: {"model": Refusal, "description": "Not done in time."},
}


class Service:
    """What the paths share: the products, the queue, and what requests hold at present."""

    def __init__(
        self, catalogue: dict[str, OfferedProduct], dispatcher: Dispatcher, limits: Limits, scratch: Path, device: str
    ) -> None:
        self.catalogue, self.dispatcher, self.limits, self.device = catalogue, dispatcher, limits, device
        self._scratch = scratch
        self._numbers = itertools.count()
        self._held = 0  # [bytes] of requests not answered yet
        self.answered = self.refused = 0
        self.ending = False

    def folder(self) -> Path:
        """A folder for an order, of a name that no other has or had; it does not exist yet."""
        return self._scratch / str(next(self._numbers))

    def warm_up(self) -> None:
        """Has a worker fit the first product on its own body, so that no caller waits for the kernels to compile."""
        product = next(iter(self.catalogue.values()))
        size, offer = next(iter(product.sizes.items()))
        order = Order(product.name, "", {size: (offer.scene, offer.changes)}, (), self.folder(), 0.0, (), "none")
        waiting = self.dispatcher.submit(order, seconds=float("inf"))
        if waiting is not None:
            waiting.future.add_done_callback(lambda future: self._report_warm_up(future.result()))

    def _report_warm_up(self, reply: Reply) -> None:
        if reply.status != HTTPStatus.OK and not self.ending:
            log.warning("the first product cannot be fitted on its own body: %s", reply.content.decode())

    async def end(self) -> None:
        """Refuses what waits, and ends the workers."""
        self.ending = True
        await asyncio.to_thread(self.dispatcher.close)

    async def fit(self, request: Request) -> Reply:
        """The reply to one request."""
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != JSON:  # a page of another site cannot send this type without asking first
            return refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, f"the request is not of type {JSON}; state it")
        pieces: list[bytes] = []
        try:
            await asyncio.wait_for(self._read(request, pieces), self.limits.upload_seconds)
            if sum(map(len, pieces)) > self.limits.request_bytes:
                most = f"{self.limits.request_bytes / 1e6:g} MB"
                return refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"the request is larger than {most}; send less")
            if self._held > self.limits.held_bytes:
                return refused(HTTPStatus.SERVICE_UNAVAILABLE, "too much is waiting; ask again later")
            return await self._answered(request, b"".join(pieces))
        except (TimeoutError, asyncio.TimeoutError):  # two classes until Python 3.11
            seconds = f"{self.limits.upload_seconds:g} s"
            return refused(HTTPStatus.REQUEST_TIMEOUT, f"the request did not arrive within {seconds}; send it faster")
        finally:
            self._held -= sum(map(len, pieces))

    async def _read(self, request: Request, pieces: list[bytes]) -> None:
        """Reads what is sent, as far as the limits allow."""
        size = 0
        async for piece in request.stream():
            pieces.append(piece)
            size += len(piece)
            self._held += len(piece)
            if size > self.limits.request_bytes or self._held > self.limits.held_bytes:
                return

    async def _answered(self, request: Request, raw: bytes) -> Reply:
        try:
            order = await asyncio.to_thread(self._order, raw)
        except InputError as error:
            bad = error.problem.startswith("is not JSON")
            return refused(HTTPStatus.BAD_REQUEST if bad else HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
        waiting = self.dispatcher.submit(order)
        if waiting is None:
            return refused(HTTPStatus.SERVICE_UNAVAILABLE, "the queue is full; ask again later")
        return await self._reply_or_gone(request, waiting)

    def _order(self, raw: bytes) -> Order:
        return order_of(parsed(raw), self.catalogue, self.folder())

    async def _reply_or_gone(self, request: Request, waiting: Waiting) -> Reply:
        """Waits for the reply; where the caller goes away, the order need not be begun."""
        reply = asyncio.wrap_future(waiting.future)
        gone = asyncio.ensure_future(_gone(request))
        try:
            await asyncio.wait((reply, gone), return_when=asyncio.FIRST_COMPLETED)
            if not reply.done():
                self.dispatcher.abandon(waiting)
                raise ClientDisconnect
            return reply.result()
        finally:
            gone.cancel()

    def health(self) -> Health:
        """How the service is."""
        counts = self.dispatcher.counts()
        return Health(
            status="ending" if self.ending else "ok" if counts.started else "starting",
            version=package_version(),
            device=self.device,
            workers=counts.workers,
            waiting=counts.waiting,
            fitting=counts.fitting,
            answered=self.answered,
            refused=self.refused,
            restarts=counts.restarts,
        )


async def _gone(request: Request) -> None:
    """Returns once the caller has closed the connection."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def make_app(service: Service) -> FastAPI:
    """The paths of a service; the queue starts and ends with it."""

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        service.warm_up()
        yield
        await service.end()

    app: FastAPI = FastAPIOffline(
        title="warp-cloth", version=package_version(), description=ABOUT, lifespan=lifespan, redoc_url=None
    )
    _add_paths(app, service)
    _add_refusals(app, service)

    def openapi() -> dict[str, Any]:
        if not app.openapi_schema:
            schema = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
            schema["components"]["schemas"].update(openapi_models())
            app.openapi_schema = schema
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]
    return app


def _add_paths(app: FastAPI, service: Service) -> None:
    # the body is read here, piece by piece within the limits, not by the framework
    examples = {name: {"value": value} for name, value in EXAMPLES.items()}
    contents = {JSON: {"schema": {"$ref": "#/components/schemas/FitRequest"}, "examples": examples}}
    extra = {"requestBody": {"required": True, "content": contents}}

    @app.post("/fit", response_model=FitAnswer, responses=REFUSALS, openapi_extra=extra)
    async def fit(request: Request) -> Response:
        """Fits a product's sizes on a body, and recommends one."""
        try:
            return _sent(service, await service.fit(request))
        except ClientDisconnect:
            return Response(status_code=499)  # nobody reads it

    @app.get("/products")
    async def products() -> list[Product]:
        """What can be asked for by name."""
        return [
            Product(name=each.name, sizes=tuple(each.sizes), fabrics=tuple(each.fabrics))
            for each in service.catalogue.values()
        ]

    @app.get("/health")
    async def health() -> Health:
        """How the service is."""
        return service.health()


def _add_refusals(app: FastAPI, service: Service) -> None:
    @app.exception_handler(HTTPException)
    async def refuse(request: Request, error: HTTPException) -> Response:
        where = f"{request.method} {request.url.path[:80]}"
        return _sent(service, refused(error.status_code, f"{where}: {error.detail}; see /docs"))

    @app.exception_handler(Exception)
    async def fail(request: Request, error: Exception) -> Response:
        reason = f"the service failed ({type(error).__name__}); tell those who run it"
        return _sent(service, refused(HTTPStatus.INTERNAL_SERVER_ERROR, reason))


def _sent(service: Service, reply: Reply) -> Response:
    if reply.status == HTTPStatus.OK:
        service.answered += 1
    else:
        service.refused += 1
    headers = {"Cache-Control": "no-store"}  # nor does anybody between keep it
    if reply.status == HTTPStatus.SERVICE_UNAVAILABLE:
        headers["Retry-After"] = RETRY_SECONDS
    return Response(reply.content, status_code=reply.status, media_type=JSON, headers=headers)
