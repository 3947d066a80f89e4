"""What set-ups share is made once, and leaves the device when it is wanted no longer."""

from __future__ import annotations

from collections.abc import Callable

from warp_cloth.base.cache import Cache


def maker(log: list[str], name: str) -> Callable[[], str]:
    def make() -> str:
        log.append(name)
        return name

    return make


def test_what_is_made_of_the_same_objects_is_made_once() -> None:
    cache, log = Cache(), list[str]()
    mesh, other = object(), object()
    for of, more in ((mesh, 1), (mesh, 1), (mesh, 2), (other, 1)):
        assert cache.get_or_make("tables", (of,), maker(log, "x"), more) == "x"
    assert len(log) == 3
    assert cache.key("tables", (mesh,), 1) in cache


def test_an_object_that_something_was_made_of_lives_as_long_as_that() -> None:
    cache = Cache()
    made = {cache.get_or_make("number", (object(),), lambda number=number: number) for number in range(100)}
    assert len(made) == 100, "none took the place of another in memory"


def test_of_device_memory_the_latest_used_is_kept_up_to_the_limit() -> None:
    cache, log = Cache(limit=100), list[str]()
    avatars = [object() for _ in range(4)]
    for number, avatar in enumerate(avatars):
        cache.get_or_make("field", (avatar,), maker(log, str(number)), size=lambda _: 50)
    cache.get_or_make("shape", (avatars[0],), maker(log, "host"))
    cache.get_or_make("field", (avatars[0],), maker(log, "again"), size=lambda _: 50)
    cache.evict_except({cache.key("field", (avatars[1],))})
    there = [cache.key("field", (avatar,)) in cache for avatar in avatars]
    assert there == [True, True, False, True], "what is wanted, and the latest two of the others"
    assert cache.key("shape", (avatars[0],)) in cache
    assert "again" not in log


def test_what_is_made_of_each_of_several_is_made_once_and_stands_in_their_order() -> None:
    cache, made = Cache(), []

    def doubled(thing: list[int]) -> list[int]:
        made.append(thing)
        return thing * 2

    one, two = [1], [2]
    assert cache.get_or_make_each("doubled", [(one,), (two,), (one,)], doubled) == [[1, 1], [2, 2], [1, 1]]
    assert cache.get_or_make_each("doubled", [(two,)], doubled) == [[2, 2]]
    assert len(made) == 2
