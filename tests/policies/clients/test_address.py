from __future__ import annotations

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.address import is_address
from pytest_libero_max.policies.clients.opening import parse_address
from pytest_libero_max.policies.clients.protocol import PROTOCOLS


@pytest.mark.parametrize(("scheme", "port"), [(name, kind.port) for name, kind in PROTOCOLS.items()])
def test_a_scheme_has_its_port_and_another_may_be_given(scheme: str, port: int) -> None:
    assert parse_address(f"{scheme}://gpu").port == port
    address = parse_address(f"{scheme}://gpu-box:7001")
    assert (address.host, address.port, address.where) == ("gpu-box", 7001, "gpu-box:7001")


def test_path_times_and_numbered_hosts_are_read() -> None:
    address = parse_address("http://[::1]:7891/v1/infer?timeout=5&patience=0.5")
    assert (address.host, address.where) == ("::1", "[::1]:7891")
    assert (address.path, address.timeout_s, address.patience_s) == ("/v1/infer", 5.0, 0.5)
    assert str(address) == "http://[::1]:7891/v1/infer"


@pytest.mark.parametrize("text", ["adapter.py", "expert", "package.module:policy", "C:\\adapter.py"])
def test_other_references_are_no_addresses(text: str) -> None:
    assert not is_address(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "tcp://gpu:10086",
            "Xiaomi-Robotics-0 speaks with pickles.*can run any code here.*one of the protocols",
        ),
        ("grpc://gpu:1", "messages are pickles"),
        ("ws://gpu:8000", "Write openpi://, vla-eval:// or starvla://"),
        ("openpy://gpu", "Did you mean 'openpi'"),
        ("openpi://", "without a user name"),
        ("openpi://me@gpu:1", "without a user name"),
        ("openpi://gpu:port", "no address"),
        ("openpi://gpu:70000", "no address"),
        ("openpi://gpu?timeout=0", "timeout='0', but must be a number of seconds above 0"),
        ("openpi://gpu?timeout=soon", "timeout='soon'"),
        ("openpi://gpu?patients=1", "Did you mean 'patience'"),
    ],
)
def test_what_is_no_usable_address_is_refused_with_the_reason(text: str, message: str) -> None:
    assert is_address(text)
    with pytest.raises(AdapterError, match=message):
        parse_address(text)
