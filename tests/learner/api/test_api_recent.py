import asyncio
import threading

import pytest

from taskschema.errors import BusError
from taskschema_learner.api.recent import MAX_KEYS, Recent


def test_readers_at_the_same_time_share_one_load():
    loads = []
    release = threading.Event()

    def load(key):
        loads.append(key)
        release.wait(10)
        return key.upper()

    async def read():
        recent = Recent(load, fresh=60.0, usable=60.0)
        readers = [asyncio.create_task(recent.get("a")) for _ in range(50)]
        await asyncio.sleep(0)
        readers[0].cancel()  # whoever started the load may hang up
        release.set()
        return await asyncio.gather(*readers[1:]), await recent.get("a")

    answers, later = asyncio.run(read())
    assert set(answers) == {"A"}
    assert later == "A"
    assert loads == ["a"]


def test_old_values_and_failures_are_loaded_again():
    outcomes = [BusError("down"), "first", "second"]

    def load(key):
        outcome = outcomes.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    async def read():
        recent = Recent(load, fresh=-1.0, usable=-1.0)
        with pytest.raises(BusError):
            await recent.get("a")
        return [await recent.get("a"), await recent.get("a")]

    assert asyncio.run(read()) == ["first", "second"]


def test_nobody_waits_while_the_old_value_is_usable():
    release = threading.Event()
    loads = []

    def load(key):
        loads.append(key)
        if len(loads) == 1:
            return "old"
        release.wait(10)
        return "new"

    async def read():
        recent = Recent(load, fresh=-1.0, usable=60.0)
        during = [await recent.get("a") for _ in range(5)]
        release.set()
        while (newest := await recent.get("a")) == "old":
            await asyncio.sleep(0.001)
        return during, newest

    assert asyncio.run(read()) == (["old"] * 5, "new")


def test_the_number_of_keys_is_bounded():
    async def read():
        recent = Recent(str.upper, fresh=60.0, usable=60.0)
        for number in range(MAX_KEYS + 10):
            await recent.get(f"run-{number}")
        return len(recent._values)

    assert asyncio.run(read()) == MAX_KEYS
