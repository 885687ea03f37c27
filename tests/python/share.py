"""Selects long tests, which are marked `full`: pytest hooks, which a conftest.py imports, deselect those that do not run today. Also
selects one of several similar things for the day."""

import os


def pytest_configure(config):
    config.addinivalue_line("markers", "full: takes long; runs with --full, and when its share has its turn")


def share_of(name, shares):
    """The share of a test by its name: its 32-bit FNV-1a hash, as xtask computes it for the Rust tests."""
    h = 0x811C9DC5
    for byte in name.encode():
        h = (h ^ byte) * 0x01000193 & 0xFFFFFFFF
    return h % shares


def pytest_collection_modifyitems(config, items):
    """Keeps the long tests that PUMICE_TEST_SHARE selects: `full` for all, `K/N` for share K of N; if it is unset, none."""
    which = os.environ.get("PUMICE_TEST_SHARE", "")
    if which == "full":
        return
    k, _, shares = which.partition("/")
    turn = [
        not item.get_closest_marker("full") or (shares and share_of(item.nodeid, int(shares)) == int(k)) for item in items
    ]
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
