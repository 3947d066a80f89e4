"""The service: the same bits as fit, refusals of one line, nothing kept of a body, and workers that die."""

from __future__ import annotations

import base64
import json
import os
import signal
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
import pytest
from services import (
    CHEAP,
    CHEAP_CHANGES,
    SIDES,
    Running,
    ball,
    cheap_request,
    digests,
    mesh_file,
    running,
    square_cloth,
)

import warp_cloth
from warp_cloth.batch.loading import LoadCache
from warp_cloth.batch.many import fit_many
from warp_cloth.batch.rows import points_digest
from warp_cloth.cli.terminal import INTERRUPTED
from warp_cloth.fitting.fit import Fit
from warp_cloth.serve.answering import OrderTask, answer
from warp_cloth.serve.catalogue import read_catalogue
from warp_cloth.serve.dispatcher import Waiting, next_task
from warp_cloth.serve.orders import Order, order_of, parsed
from warp_cloth.serve.schema import ANSWER, EXAMPLES, FitAnswer

pytest.importorskip("fastapi")
pytest.importorskip("fastapi_offline")
if not Path("/proc/self/stat").exists():
    pytest.skip("workers are found under /proc", allow_module_level=True)

QUEUE = 4  # of the service


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("serve")
    with started(folder, "--max-mb", "0.2", environment={"WARP_CLOTH_CACHE": str(folder / "cache")}) as service:
        yield service
        service.process.kill()
        until(lambda: not service.scratch.exists())  # the workers have seen to it
    assert not (folder / "cache").exists()  # where a fit of one's own may keep what it made for a body


@contextmanager
def started(folder: Path, *limits: str, environment: dict[str, str] | None = None) -> Iterator[Running]:
    """A service of the cheap product with one worker, which has compiled its kernels."""
    catalogue = folder / "catalogue.toml"
    catalogue.write_text(CHEAP)
    words = [str(catalogue), "--device", "cpu", "--workers", "1", "--queue", str(QUEUE), *limits]
    with running(*words, environment=environment) as service:
        service.until_warm()
        yield service


def alone(folder: Path, radius: float, size: str, **options: Any) -> Fit:
    """What ``warp_cloth.fit`` makes of the same size on the same body."""
    body = folder / f"{radius}.obj"
    body.write_bytes(ball(radius))
    changes = [*CHEAP_CHANGES, f"garment.shape.side={SIDES[size]}", f'avatar={{mesh="{body}", units="m"}}']
    return warp_cloth.fit("sphere", device="cpu", overrides=changes, **options)


def test_answers_have_the_bits_of_fit(service: Running, tmp_path: Path) -> None:
    request = cheap_request(0.3, ("M", "L"), maps=["gap"], glb="worn")
    status, answer = service.post(request)
    assert status == 200, answer
    FitAnswer.model_validate(answer)
    assert [each["size"] for each in answer["sizes"]] == ["M", "L"]
    for each in answer["sizes"]:
        fit = alone(tmp_path, 0.3, each["size"], maps="gap")
        assert each["digest"] == points_digest([worn.points for worn in fit.garments])
        assert (each["status"], each["worn"], each["message"]) == (fit.status.value, fit.worn, fit.message)
        values = np.frombuffer(base64.b64decode(each["maps"]["gap"]["values"]["square"]), dtype="<f4")
        assert np.array_equal(values, fit.garments[0].fields["gap"])
        assert base64.b64decode(each["glb"]).startswith(b"glTF")


def test_requests_at_once_each_get_their_own_garment(service: Running) -> None:
    radii = (0.2, 0.25, 0.3)
    before = {radius: service.post(cheap_request(radius))[1] for radius in radii}
    assert len({digest for answer in before.values() for digest in digests(answer).values()}) == 9
    with ThreadPoolExecutor(QUEUE) as pool:
        at_once = list(pool.map(lambda radius: service.post(cheap_request(radius))[1], radii))
    for radius, found in zip(radii, at_once, strict=True):
        assert digests(found) == digests(before[radius])


def test_a_garment_of_ones_own_needs_no_catalogue(service: Running) -> None:
    garments = {"only": mesh_file(square_cloth()), "../none": mesh_file(b"v")}
    request = {"garments": garments, "fabric": "jersey", "body": {"mesh": mesh_file(ball(0.25))}}
    status, answer = service.post(request)
    assert status == 200, answer
    assert [(each["size"], each["worn"]) for each in answer["sizes"]] == [("only", True), ("../none", False)]
    assert answer["sizes"][1]["message"].startswith("garment_number_1.obj:1: ")
    assert answer["recommended"] == "only"


def test_a_size_that_is_named_like_anothers_place_keeps_its_own_garment(service: Running) -> None:
    garments = {"1": mesh_file(square_cloth()), "größer": mesh_file(square_cloth(0.4))}
    request = {"garments": garments, "fabric": "jersey", "body": {"mesh": mesh_file(ball(0.25))}}
    together = digests(service.post(request)[1])
    for size in garments:
        alone = service.post({**request, "sizes": [size]})[1]
        assert digests(alone) == {size: together[size]}
    assert together["1"] != together["größer"]


@pytest.mark.parametrize(
    "written", [lambda data: "data:model/obj;base64," + data, lambda data: "\r\n".join(wrap(data, 76))]
)
def test_base64_may_be_as_browsers_and_shells_write_it(service: Running, written: Callable[[str], str]) -> None:
    body = mesh_file(ball(0.25))
    request = {"product": "cloth", "sizes": ["S"], "body": {"mesh": body}}
    plain = service.post(request)[1]
    status, answer = service.post({**request, "body": {"mesh": {**body, "data": written(str(body["data"]))}}})
    assert status == 200, answer
    assert digests(answer) == digests(plain)


BODY = {"mesh": mesh_file(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")}


@pytest.mark.parametrize(
    ("content", "status", "said"),
    [
        (b"{", 400, "not JSON"),
        (b"\xff\xfe", 400, "not JSON"),
        (b"[" * 90_000, 400, "not JSON"),
        ([], 422, "must be a table"),
        ({"product": "cloth"}, 422, "body: is missing"),
        ({"product": "clot", "body": BODY}, 422, "did you mean cloth?"),
        ({"product": "../../etc/passwd", "body": BODY}, 422, "no product"),
        ({"product": 5, "body": BODY}, 422, "product: must be a string, not 5"),
        ({"body": BODY}, 422, "either product or garments"),
        ({"garments": {str(n): mesh_file(b"v") for n in range(17)}, "body": BODY}, 422, "garments"),
        ({"garments": {"m": mesh_file(b"v"), "M": mesh_file(b"v")}, "body": BODY}, 422, "differ by case alone"),
        ({"garments": {"M": {**mesh_file(b"v"), "format": "json"}}, "body": BODY}, 422, 'format: must be one of "obj"'),
        ({"product": "x" * 300, "body": BODY}, 422, "product: has 300 letters; at most 200"),
        ({"product": "cloth", "body": BODY, "maps": ["gap"] * 17}, 422, "maps: has 17 entries; at most 16"),
        (None, 422, "must be a table, not null"),
        ({"product": "cloth", "body": {}}, 422, "either mesh or measures"),
        ({"product": "cloth", "body": {"measures": {"chest": 1e300}}}, 422, "from 0.7 to 1.5"),
        (b'{"product": "cloth", "body": {"measures": {"chest": NaN}}}', 422, "chest"),
        ({"product": "cloth", "body": BODY, "sizes": ["XXL"]}, 422, "choose from S, M, L"),
        ({"product": "cloth", "body": BODY, "fabric": "/etc/passwd"}, 422, "no fabric"),
        ({"product": "cloth", "body": BODY, "maps": ["gapp"]}, 422, 'did you mean "gap"?'),
        ({"product": "cloth", "body": BODY, "ease_cm": 1e9}, 422, "from -200 to 200"),
        ({"product": "cloth", "body": BODY, "colour": "red"}, 422, "unknown key colour"),
        ({"product": "cloth", "body": {"mesh": {**mesh_file(b""), "data": "%%"}}}, 422, "not base64"),
        ({"product": "cloth", "body": {"mesh": {**mesh_file(b"x"), "format": "usda"}}}, 422, "one of"),
        ({"product": "cloth", "body": {"mesh": mesh_file(b"v 0 0 0")}}, 422, "body.obj: "),
        ({"product": "cloth", "body": {"mesh": mesh_file(b"v 0 0 nan\nf 1 1 1")}}, 422, "body.obj"),
        (b" " * 300_000, 413, "larger than 0.2 MB"),
    ],
)
def test_bad_requests_are_refused_in_one_line(service: Running, content: Any, status: int, said: str) -> None:
    code, answer = service.post(content)
    assert code == status, answer
    assert said in answer["error"]
    assert "\n" not in answer["error"]
    assert "Traceback" not in answer["error"]
    assert not any(str(folder) in answer["error"] for folder in (service.scratch.parent, tempfile.gettempdir()))


def test_a_mesh_may_not_name_other_files(service: Running, tmp_path: Path) -> None:
    secret = tmp_path / "secret.bin"
    secret.write_bytes(bytes(1000))
    tree = f'{{"asset":{{"version":"2.0"}},"buffers":[{{"uri":"{secret}","byteLength":1000}}]}}'.encode()
    tree += b" " * (-len(tree) % 4)
    data = b"glTF" + np.array([2, 20 + len(tree), len(tree)], dtype="<u4").tobytes() + b"JSON" + tree
    status, answer = service.post({"product": "cloth", "body": {"mesh": mesh_file(data, "glb")}})
    assert status == 422
    assert "names another file" in answer["error"]


def test_orders_of_one_task_each_get_their_own_reply(tmp_path: Path) -> None:
    (tmp_path / "catalogue.toml").write_text(CHEAP)
    catalogue = read_catalogue([str(tmp_path / "catalogue.toml")])
    requests = [
        cheap_request(0.3, ("S",)),
        {"product": "cloth", "body": {"mesh": mesh_file(b"no mesh")}},
        cheap_request(0.2, ("L", "S"), maps=["gap"]),
    ]
    orders = [
        order_of(parsed(json.dumps(each).encode()), catalogue, tmp_path / str(number)).written()
        for number, each in enumerate(requests)
    ]
    together = answer(OrderTask(tuple(orders), "cpu", lease=tmp_path / "cpu.lease"), LoadCache(0))
    assert [reply.status for reply in together] == [200, 422, 200]
    for order, reply in zip(orders, together, strict=True):
        (alone,) = answer(OrderTask((order,), "cpu"), LoadCache(0))
        assert alone.status == reply.status
        if reply.status == 200:
            said, right = json.loads(reply.content), json.loads(alone.content)
            assert said.pop("seconds") > 0 < right.pop("seconds")
            assert said == right


def test_orders_that_state_the_same_are_fitted_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "catalogue.toml").write_text(CHEAP)
    catalogue = read_catalogue([str(tmp_path / "catalogue.toml")])
    order = order_of(parsed(json.dumps(cheap_request(0.3, ("S", "L"))).encode()), catalogue, tmp_path / "order")
    counts = []

    def counted(scenes: Sequence[Any], *args: Any, **options: Any) -> list[Any]:
        counts.append(len(scenes))
        return fit_many(scenes, *args, **options)

    monkeypatch.setattr("warp_cloth.batch.many.fit_many", counted)
    both = answer(OrderTask((order.written(), replace(order, files=(), glb="none")), "cpu"), LoadCache(0))
    assert [reply.status for reply in both] == [200, 200]
    assert counts == [2]
    digests_of = [[size["digest"] for size in json.loads(reply.content)["sizes"]] for reply in both]
    assert digests_of[0] == digests_of[1]


def waiting_for(bodies: str) -> list[Waiting]:
    """Orders for bodies of these names, a letter each."""
    return [Waiting(Order("", body, {}, (), Path(), 0.0, (), "none"), 0.0) for body in bodies]


@pytest.mark.parametrize(
    ("bodies", "device", "workers", "together", "expected"),
    [
        ("abcabc", "cpu", 2, 64, "aa"),  # on the CPU one body a task
        ("a" * 20, "cpu", 2, 64, "a" * 8),
        ("abcabc", "cuda:0", 1, 64, "aabbcc"),
        ("abcabc", "cuda:0", 1, 3, "aab"),
        ("abcabc", "cuda:0", 2, 64, "aa"),  # half of the queue is 3, the next body has 2 more
        ("abcdef", "cuda:0", 2, 64, "abc"),
        ("aaaaab", "cuda:0", 3, 64, "aaaaa"),  # one body stays with one worker
    ],
)
def test_orders_for_one_body_go_to_one_worker_and_the_others_are_shared(
    bodies: str, device: str, workers: int, together: int, expected: str
) -> None:
    chosen = next_task(waiting_for(bodies), device, workers, together)
    assert "".join(each.order.body for each in chosen) == expected


def test_an_order_whose_worker_died_goes_alone() -> None:
    waiting = waiting_for("aab")
    waiting[0].tries = 1
    assert next_task(waiting, "cuda:0", 1, 64) == waiting[:1]
    assert next_task(waiting[1:], "cuda:0", 1, 64) == waiting[1:]
    assert next_task([*waiting[1:], waiting[0]], "cuda:0", 1, 64) == waiting[1:]


def test_wrong_paths_and_kinds_are_refused_likewise(service: Running) -> None:
    assert service.get("/nothing")[0] == 404
    assert service.get("/fit")[0] == 405
    assert "error" in service.get("/fit")[1]
    assert service.post({}, kind="text/plain")[0] == 415


def test_it_says_how_it_is_and_what_it_takes(service: Running) -> None:
    assert service.get("/products")[1][0]["sizes"] == ["S", "M", "L"]
    health = service.get("/health")[1]
    assert (health["status"], health["waiting"], health["device"]) == ("ok", 0, "cpu")
    schema = service.get("/openapi.json")[1]
    assert schema["components"]["schemas"]["FitRequest"]["examples"] == list(EXAMPLES.values())
    for example in EXAMPLES.values():
        parsed(json.dumps(example).encode())
    FitAnswer.model_validate(ANSWER)
    assert "swagger" in service.get("/docs")[1]


def files_left(service: Running) -> list[Path]:
    return [path for path in service.scratch.rglob("*") if path.suffix != ".lease"]


def test_no_file_is_left_of_a_body(service: Running) -> None:
    assert service.post(cheap_request(0.3, ("S",), glb="worn"))[0] == 200
    assert service.post({"product": "cloth", "body": BODY})[0] in (200, 422)
    assert not files_left(service)


def test_a_worker_forgets_bodies_and_takes_over_what_another_left(tmp_path: Path) -> None:
    (tmp_path / "catalogue.toml").write_text(CHEAP)
    catalogue = read_catalogue([str(tmp_path / "catalogue.toml")])
    order = order_of(parsed(json.dumps(cheap_request(0.3, ("S",))).encode()), catalogue, tmp_path / "0")
    assert not order.folder.exists()
    for _ in range(2):
        sent = order.written()
        assert not sent.files
        load_cache = LoadCache(0)
        (reply,) = answer(OrderTask((sent,), "cpu"), load_cache)
        assert reply.status == 200, reply.content
        assert load_cache.mesh_cache.count == load_cache.cache.count == load_cache.mesh_cache.drafts.count == 0
    order.remove()
    assert not order.folder.exists()


def test_a_killed_worker_is_replaced_and_its_request_answered(service: Running) -> None:
    right = digests(service.post(cheap_request(0.3))[1])
    (worker,) = service.workers()
    os.kill(worker, signal.SIGSTOP)  # so that it has not finished when it is killed
    with ThreadPoolExecutor(1) as pool:
        reply = pool.submit(service.post, cheap_request(0.3))
        until(lambda: service.get("/health")[1]["fitting"] == 1)
        os.kill(worker, signal.SIGKILL)
        status, answer = reply.result()
    assert status == 200, answer
    assert digests(answer) == right
    assert service.workers() != [worker]
    assert service.get("/health")[1]["restarts"] >= 1
    assert not files_left(service)


def test_what_cannot_be_answered_in_time_is_refused(tmp_path: Path) -> None:
    request = cheap_request(0.3, ("S",))
    with started(tmp_path, "--timeout", "5") as service, ThreadPoolExecutor(QUEUE) as pool:
        (worker,) = service.workers()
        os.kill(worker, signal.SIGSTOP)
        waiting = [pool.submit(service.post, request) for _ in range(QUEUE)]
        until(lambda: at_work(service) == QUEUE)
        assert service.post(request) == (503, {"error": "the queue is full; ask again later"})
        assert {reply.result()[0] for reply in waiting} == {504}
        until(lambda: at_work(service) == 0)
        assert worker not in service.workers()  # it was ended
        assert not files_left(service)
        assert service.post(request)[0] == 200  # by another

        (worker,) = service.workers()
        os.kill(worker, signal.SIGSTOP)
        first = pool.submit(service.post, request)
        until(lambda: at_work(service) == 1)
        with leaving(service, request):
            until(lambda: at_work(service) == 2)
        until(lambda: at_work(service) == 1)  # nobody waits for that one
        service.process.send_signal(signal.SIGTERM)
        assert first.result() == (503, {"error": "the service is ending; ask again later"})
        assert service.process.wait(30) == 128 + signal.SIGTERM
        assert not service.scratch.exists()


def at_work(service: Running) -> int:
    """Requests that wait or are being fitted."""
    health = service.get("/health")[1]
    return int(health["waiting"] + health["fitting"])


@contextmanager
def leaving(service: Running, content: Any) -> Iterator[None]:
    """Asks, and goes away at the end of the block without an answer."""
    host, port = service.address.removeprefix("http://").split(":")
    data = json.dumps(content).encode()
    head = f"POST /fit HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: {len(data)}\r\n\r\n"
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(head.encode() + data)
        yield


def until(condition: Any, seconds: float = 20.0) -> None:
    """Waits until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_ctrl_c_as_soon_as_the_address_is_told_ends_the_service() -> None:
    """Before the HTTP server runs, too, which closes the queue when it ends."""
    with running("--workers", "1") as service:
        service.process.send_signal(signal.SIGINT)
        assert service.process.wait(30) == INTERRUPTED
