"""Servers as the user names them: lists, files, host names of several machines."""

from __future__ import annotations

import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.adapter_digest import adapter_digest
from pytest_libero_max.policies.clients.fleet import ServerFleet, in_order_of
from pytest_libero_max.policies.clients.servers import read_servers, require_known_marks
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.profile import declares_weights, load_profile, suite_of_key

MAP = """
name = "gr00t"
[[servers]]
for = ["libero_goal"]
addresses = ["gr00t://a:5555", "gr00t://b:5555"]
profile = "gr00t_n17"
revision = "goal-20k"
[[servers]]
address = "gr00t://c:5555"
"""


def test_a_list_is_one_group_asked_like_a_single_server() -> None:
    several = read_servers("openpi://a:8000, openpi://b:8000?patience=3", "pi05_libero")
    assert several.addresses == ("openpi://a:8000", "openpi://b:8000?patience=3")
    assert several.digest == adapter_digest("openpi://c:8000", "pi05_libero")
    assert several.groups[0].marks == ()


def test_a_file_maps_markers_to_servers(tmp_path: Path) -> None:
    path = tmp_path / "servers.toml"
    path.write_text(MAP)
    servers = read_servers(str(path), "gr00t_n17", "rest-20k")
    assert [group.revision for group in servers.groups] == ["goal-20k", "rest-20k"]
    assert servers.group_of({"libero_goal", "camera_shift"}) == 0
    assert servers.group_of({"libero_10"}) == 1
    assert (
        servers.digest
        == adapter_digest(str(path), "gr00t_n17", "rest-20k")
        != servers.groups[0].profile.digest
    )
    require_known_marks(servers, ("libero_goal", "libero_10"))
    with pytest.raises(AdapterError, match=r"'libero_goal'.* no marker"):
        require_known_marks(servers, ("libero_10",))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("servers = 1", "lacks .*servers.* tables"),
        ("[[servers]]\nadress = 'x'", "'adress' is unknown. Did you mean 'address'"),
        ("[[servers]]\nfor = ['libero_goal']", "either 'address' or 'addresses'"),
        ("[[servers]]\naddress = 'a:8000'", "'a:8000' in .* is no address"),
        ("[[servers]]\naddresses = ['openpi://a', 'openpi://a']", "openpi://a is listed twice"),
        (
            "[[servers]]\naddress = 'openpi://a'\n[[servers]]\naddress = 'openpi://b'",
            "two groups have no 'for'",
        ),
        (
            "[[servers]]\nfor = ['libero_10']\naddress = 'openpi://a'\n"
            "[[servers]]\naddress = 'openpi://b'\nprofile = 'fastwam'",
            "several policies .fast-wam, pi05-libero.*give its `name`",
        ),
        (
            "[[servers]]\naddress = 'openpi://a'\nrevision = 3",
            "revision=3, but must be text that is not empty",
        ),
        ("[[servers", "cannot be read"),
    ],
)
def test_a_bad_file_is_told_what_is_wrong(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "servers.toml"
    path.write_text(content)
    with pytest.raises(AdapterError, match=message):
        read_servers(str(path), "pi05_libero")


def test_a_profile_of_one_suite_is_refused_for_another(tmp_path: Path) -> None:
    profile = tmp_path / "goal.toml"
    profile.write_text('extends = "openvla_oft"\n[policy]\nunnorm_key = "libero_goal_no_noops"\n')
    assert load_profile(str(profile)).suites == ("libero_goal",)
    path = tmp_path / "servers.toml"
    path.write_text('[[servers]]\nfor = ["libero_10"]\naddress = "http://a:8777"\nprofile = "goal.toml"\n')
    with pytest.raises(AdapterError, match="'goal' is for libero_goal"):
        read_servers(str(path), None)


@pytest.mark.parametrize(
    ("key", "suite"),
    [
        ("libero_spatial_no_noops", "libero_spatial"),
        ("libero_10", "libero_10"),
        ("libero_100", None),
        ("franka", None),
        ("libero_goal+libero_object", None),
        (None, None),
    ],
)
def test_a_key_of_statistics_names_a_suite(key: str | None, suite: str | None) -> None:
    assert suite_of_key(key) == suite


def test_a_host_of_several_machines_is_as_many_servers(monkeypatch: pytest.MonkeyPatch) -> None:
    def look_up(host: str, *rest: Any) -> Any:
        found = {"fleet": ["10.0.0.2", "10.0.0.1"], "one": ["10.0.0.3"]}[host]
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (ip, 8000)) for ip in found]

    monkeypatch.setattr(socket, "getaddrinfo", look_up)
    servers = read_servers("openpi://fleet?patience=3,openpi://one", "pi05_libero").resolved()
    assert servers.addresses == (
        "openpi://10.0.0.1:8000?patience=3",
        "openpi://10.0.0.2:8000?patience=3",
        "openpi://one",
    )


def test_seats_spread_over_servers_also_after_one_is_left_out() -> None:
    orders = [in_order_of(("a", "b", "c"), seat) for seat in range(6)]
    assert [order[0] for order in orders] == ["a", "b", "c", "a", "b", "c"]
    assert orders[0][1] != orders[3][1]
    assert all(sorted(order) == ["a", "b", "c"] for order in orders)


@pytest.mark.parametrize(
    ("revision", "declared"),
    [
        ("profile pi05_libero 0123456789ab", False),
        ("adapter 0123, profile fastwam 0123456789ab", True),
        ("libero_goal: a; libero_10: b", True),
        ("libero_goal: a; libero_10: profile x 0123456789ab", False),
    ],
)
def test_a_profile_alone_declares_no_weights(revision: str, declared: bool) -> None:
    assert declares_weights(revision) is declared


def test_groups_of_the_same_declared_weights_are_one_policy(tmp_path: Path) -> None:
    path = tmp_path / "servers.toml"
    groups = (
        '[[servers]]\nfor = ["libero_goal"]\naddress = "openpi://a"\n[[servers]]\naddress = "openpi://b"\n'
    )
    path.write_text(groups)
    one, several = (read_servers(text, "pi05_libero", "w") for text in ("openpi://c", str(path)))
    assert (several.digest, several.revision) == (one.digest, "w")
    undeclared = read_servers(str(path), "pi05_libero")
    assert undeclared.digest != read_servers("openpi://c", "pi05_libero").digest
    path.write_text(f'{groups}revision = "x"\n')
    others = read_servers(str(path), "pi05_libero", "w")
    assert others.digest != one.digest
    assert others.revision == "libero_goal: w; other: x"


def test_a_method_that_is_kept_reaches_the_server_that_is_asked_by_then() -> None:
    servers = read_servers("openpi://a,openpi://b", "pi05_libero")
    first, second = (SimpleNamespace(snapshot=lambda name=name: name, batch_size=3) for name in ("a", "b"))
    pool: Any = SimpleNamespace(left_out={}, declared=PolicySpec("x"), policy=first)
    fleet = ServerFleet(servers, [pool])
    snapshot = fleet.snapshot
    assert (snapshot(), fleet.batch_size, hasattr(fleet, "see")) == ("a", 3, False)
    pool.policy = second
    assert snapshot() == "b"
