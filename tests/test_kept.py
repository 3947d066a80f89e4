"""What set-ups share is made once, and leaves the device when it is wanted no longer."""

from __future__ import annotations

from collections.abc import Callable

from warp_cloth.base.cache import Kept


def maker(log: list[str], name: str) -> Callable[[], str]:
    def make() -> str:
        log.append(name)
        return name

    return make


def test_what_is_made_of_the_same_objects_is_made_once() -> None:
    kept, log = Kept(), list[str]()
    mesh, other = object(), object()
    for of, more in ((mesh, 1), (mesh, 1), (mesh, 2), (other, 1)):
        assert kept.once("tables", (of,), maker(log, "x"), more) == "x"
    assert len(log) == 3
    assert kept.key("tables", (mesh,), 1) in kept


def test_an_object_that_something_was_made_of_lives_as_long_as_that() -> None:
    kept = Kept()
    made = {kept.once("number", (object(),), lambda number=number: number) for number in range(100)}
    assert len(made) == 100, "none took the place of another in memory"


def test_of_device_memory_the_latest_used_is_kept_up_to_the_limit() -> None:
    kept, log = Kept(limit=100), list[str]()
    avatars = [object() for _ in range(4)]
    for number, avatar in enumerate(avatars):
        kept.once("field", (avatar,), maker(log, str(number)), size=lambda _: 50)
    kept.once("shape", (avatars[0],), maker(log, "host"))
    kept.once("field", (avatars[0],), maker(log, "again"), size=lambda _: 50)
    kept.make_room({kept.key("field", (avatars[1],))})
    there = [kept.key("field", (avatar,)) in kept for avatar in avatars]
    assert there == [True, True, False, True], "what is wanted, and the latest two of the others"
    assert kept.key("shape", (avatars[0],)) in kept
    assert "again" not in log


def test_what_is_made_of_each_of_several_is_made_once_and_stands_in_their_order() -> None:
    kept, made = Kept(), []

    def doubled(thing: list[int]) -> list[int]:
        made.append(thing)
        return thing * 2

    one, two = [1], [2]
    assert kept.each("doubled", [(one,), (two,), (one,)], doubled) == [[1, 1], [2, 2], [1, 1]]
    assert kept.each("doubled", [(two,)], doubled) == [[2, 2]]
    assert len(made) == 2
