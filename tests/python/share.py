"""Selects long tests, which are marked `full`, and tests that take turns, which are marked `turn`: pytest hooks, which a conftest.py
imports, deselect those that do not run today. Also selects one of several similar things for the day."""

import os


def pytest_configure(config):
    config.addinivalue_line("markers", "full: takes long; runs with --full, and when its share has its turn")
    config.addinivalue_line("markers", "turn(day, days): runs with --full, and once in so many days, of which this is the day, from 0 on")


def share_of(name, shares):
    """The share of a test by its name: its 32-bit FNV-1a hash, as xtask computes it for the Rust tests."""
    h = 0x811C9DC5
    for byte in name.encode():
        h = (h ^ byte) * 0x01000193 & 0xFFFFFFFF
    return h % shares


def pytest_collection_modifyitems(config, items):
    """Keeps the tests that PUMICE_TEST_SHARE selects. `full` is all. `K/N` is share K of N of the long ones, and K is the day of those that
    take turns; if it is unset, no long ones, and the day is 0."""
    which = os.environ.get("PUMICE_TEST_SHARE", "")
    if which == "full":
        return
    k, _, shares = which.partition("/")

    def runs(item):
        if item.get_closest_marker("full"):
            return shares and share_of(item.nodeid, int(shares)) == int(k)
        return all(int(k or 0) % mark.args[1] == mark.args[0] for mark in item.iter_markers("turn"))

    turn = [runs(item) for item in items]
    config.hook.pytest_deselected(items=[i for i, t in zip(items, turn) if not t])
    items[:] = [i for i, t in zip(items, turn) if t]


def one_of_today(things):
    """A list of the one thing that PUMICE_TEST_SHARE selects, which changes daily; all for `full`; the first if it is unset."""
    return some_of_today(things, len(things))


def some_of_today(things, days):
    """Those of the things that PUMICE_TEST_SHARE selects: each of them has its turn in as many days; all for `full`."""
    which = os.environ.get("PUMICE_TEST_SHARE", "")
    if which == "full":
        return list(things)
    return list(things)[int(which.partition("/")[0] or 0) % days :: days]
