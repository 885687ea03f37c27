"""Long tests, marked `full`: hooks of pytest that leave out those whose turn it is not. A conftest.py imports them. And the choice of
those of several alike whose turn it is."""

import os


def pytest_configure(config):
    config.addinivalue_line("markers", "full: takes long; runs with --full, and when its share has its turn")


def share_of(name, shares):
    """32-bit FNV-1a, as xtask computes it for the Rust tests."""
    h = 0x811C9DC5
    for byte in name.encode():
        h = (h ^ byte) * 0x01000193 & 0xFFFFFFFF
    return h % shares


def pytest_collection_modifyitems(config, items):
    """PUMICE_TEST_SHARE is `full`, or `K/N`: of the tests marked full, share K of N; unset: none of them."""
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
    """One of them each day, as PUMICE_TEST_SHARE says; all with `full`, the first where it is unset."""
    which = os.environ.get("PUMICE_TEST_SHARE", "")
    if which == "full":
        return list(things)
    return [things[int(which.partition("/")[0] or 0) % len(things)]]
