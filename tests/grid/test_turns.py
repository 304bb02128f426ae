"""Threads take turns: never more than there are, and one that waits does not keep its own."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from workflow.grid._turns import Over, Turns, waiting


@pytest.mark.parametrize("count", [1, 2, 3])
def test_no_more_threads_than_turns(count: int) -> None:
    turns, inside, seen, lock = Turns(count), 0, [], threading.Lock()
    full = threading.Barrier(count)

    def one(_: int) -> None:
        nonlocal inside
        with turns:
            with lock:
                inside += 1
                seen.append(inside)
            full.wait(60)  # all turns are used at a time, or this breaks
            with lock:
                inside -= 1
            full.wait(60)

    with ThreadPoolExecutor(4 * count) as pool:
        list(pool.map(one, range(4 * count)))
    assert max(seen) == count


def test_who_waits_lets_another_compute_and_then_takes_its_turn_again() -> None:
    """There is one turn: what the first waits for is done by the second, which needs it."""
    turns, done = Turns(1), threading.Event()
    order = []

    def first() -> None:
        with turns:
            with waiting():
                assert done.wait(60)
            order.append("first")

    def second() -> None:
        with turns:
            order.append("second")
            done.set()

    with ThreadPoolExecutor(2) as pool:
        for finished in [pool.submit(first), pool.submit(second)]:
            finished.result(60)
    assert order == ["second", "first"]
    with turns:
        pass


def test_an_error_gives_the_turn_back() -> None:
    turns = Turns(1)
    with pytest.raises(ValueError, match="waited"), turns, waiting():
        raise ValueError("waited")
    with turns:
        pass


def test_waiting_without_a_turn_is_allowed() -> None:
    with waiting():
        pass


def test_when_it_is_over_nobody_gets_a_turn() -> None:
    """Neither those that come nor those that waited for something and would go on."""
    turns, begun, over = Turns(1), threading.Event(), threading.Event()

    def one() -> None:
        with turns, waiting():
            begun.set()
            assert over.wait(60)

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(one)
        assert begun.wait(60)
        turns.end()
        over.set()
        assert isinstance(running.exception(60), Over)
    with pytest.raises(Over):
        turns.__enter__()
