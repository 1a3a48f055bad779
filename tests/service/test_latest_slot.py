"""The slot between two stages."""

from __future__ import annotations

import threading

from program_fakes import wait_until

from service.latest_slot import LatestSlot


def test_the_taker_gets_the_newest_and_the_rest_is_counted_as_dropped() -> None:
    slot: LatestSlot[int] = LatestSlot()
    for value in range(5):
        slot.put(value)
    assert slot.take() == 4
    assert (slot.put_count, slot.dropped_count) == (5, 4)


def test_a_value_is_taken_once() -> None:
    slot: LatestSlot[int] = LatestSlot()
    slot.put(7)
    assert slot.take() == 7
    assert slot.take() is None
    assert slot.dropped_count == 0


def test_a_value_of_zero_is_a_value() -> None:
    slot: LatestSlot[int] = LatestSlot()
    slot.put(0)
    assert slot.take() == 0


def test_close_wakes_a_taker_that_waits_for_ever() -> None:
    slot: LatestSlot[int] = LatestSlot()
    answers: list[int | None] = []
    taker = threading.Thread(target=lambda: answers.append(slot.take(None)))
    taker.start()
    slot.close()
    wait_until(lambda: answers == [None])
    taker.join()


def test_after_close_the_value_inside_is_left_and_no_new_one_comes() -> None:
    slot: LatestSlot[int] = LatestSlot()
    slot.put(1)
    slot.close()
    slot.put(2)
    assert slot.take() == 1
    assert slot.take(None) is None
    assert slot.put_count == 1


def test_many_threads_lose_nothing_that_is_not_counted() -> None:
    slot: LatestSlot[int] = LatestSlot()
    taken: list[int] = []

    def take_all() -> None:
        while True:
            value = slot.take(None)
            if value is None:
                return
            taken.append(value)

    taker = threading.Thread(target=take_all)
    givers = [threading.Thread(target=lambda: [slot.put(i) for i in range(1000)]) for _ in range(4)]
    for thread in (taker, *givers):
        thread.start()
    for thread in givers:
        thread.join()
    slot.close()
    taker.join()
    assert len(taken) + slot.dropped_count == slot.put_count == 4000
