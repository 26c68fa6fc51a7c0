"""The wrappers that are installed, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.policies.wrapping import WrappedPolicy


def _accept(name: str, wrapper: Any) -> type[WrappedPolicy]:
    from pytest_libero_max.policies.wrapping import WrappedPolicy

    if not (isinstance(wrapper, type) and issubclass(wrapper, WrappedPolicy) and wrapper.modes):
        raise ValueError(f"{wrapper!r} is not a subclass of WrappedPolicy with modes")
    return wrapper


WRAPPERS: Registry[type[WrappedPolicy]] = Registry(
    "wrapper", "pytest_libero_max.wrappers", dict, _accept, OptionError
)
"""Each is called with a policy and one of its ``modes``."""


def setting_of(words: str) -> tuple[str, str]:
    """Return name and setting of a wrapper by its words in a spec, for example ``restore=gated``."""
    name, _, setting = words.partition(" ")[0].partition("=")
    return name, setting
