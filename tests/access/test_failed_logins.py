"""Wrong tokens are slowed by client, up to a bound, in a table that has one too."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from service.access.failed_logins import FREE_TRIES, LONGEST_WAIT_S, MOST_CLIENTS, WINDOW_S, FailedLogins


class Clock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


def test_the_first_few_are_free_then_the_wait_grows_to_its_bound():
    failed = FailedLogins(clock=Clock())

    waits = [failed.failed("192.0.2.1") for _ in range(20)]

    assert waits[:FREE_TRIES] == [0.0] * FREE_TRIES
    assert waits[FREE_TRIES] > 0
    assert waits[FREE_TRIES:] == sorted(waits[FREE_TRIES:])
    assert waits[-1] == LONGEST_WAIT_S
    assert failed.failed("192.0.2.2") == 0.0


def test_one_who_waits_as_told_may_try_once():
    clock = Clock()
    failed = FailedLogins(clock=clock)
    for _ in range(FREE_TRIES):
        failed.failed("192.0.2.1")
    wait = failed.failed("192.0.2.1")

    clock.now += wait
    assert failed.failed("192.0.2.1") == 0.0
    assert failed.failed("192.0.2.1") > wait


def test_after_a_quiet_window_all_is_forgotten():
    clock = Clock()
    failed = FailedLogins(clock=clock)
    for _ in range(50):
        failed.failed("192.0.2.1")

    clock.now += WINDOW_S + 1

    assert [failed.failed("192.0.2.1") for _ in range(FREE_TRIES)] == [0.0] * FREE_TRIES


def test_addresses_of_one_subscriber_count_together():
    failed = FailedLogins(clock=Clock())

    waits = [failed.failed(f"2001:db8::{number:x}") for number in range(20)]

    assert waits[-1] == LONGEST_WAIT_S
    assert len(failed) == 1


@given(st.lists(st.tuples(st.integers(0, 3), st.floats(0, 100)), max_size=100))
def test_no_wait_is_longer_than_the_bound_and_none_is_before_the_free_tries(tries):
    clock = Clock()
    failed = FailedLogins(clock=clock)
    counts = [0] * 4
    for client, pause in tries:
        clock.now += pause
        counts[client] += 1
        wait = failed.failed(f"192.0.2.{client}")
        assert 0 <= wait <= LONGEST_WAIT_S
        assert wait == 0 or counts[client] > FREE_TRIES


def test_the_table_is_bounded_and_keeps_those_who_tried_last():
    failed = FailedLogins(clock=Clock())
    for number in range(MOST_CLIENTS + 500):
        failed.failed(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}")
        if number % 100 == 0:
            for _ in range(2):
                failed.failed("192.0.2.1")

    assert len(failed) == MOST_CLIENTS
    assert failed.failed("192.0.2.1") > 0


def test_the_bounds_are_those_that_were_chosen():
    failed = FailedLogins(free=2, longest_wait_s=3600.0, most=100, clock=Clock())

    assert [failed.failed("192.0.2.1") > 0 for _ in range(3)] == [False, False, True]
    assert max(failed.failed("192.0.2.1") for _ in range(30)) == 3600.0
    for number in range(200):
        failed.failed(f"198.51.100.{number}")
    assert len(failed) == 100
