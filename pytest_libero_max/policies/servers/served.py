"""A policy behind a server: a profile, a protocol, and the contract of a policy around them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError, ServerError, did_you_mean
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.pieces.actions import Statistics, read_statistics, unnormalise
from pytest_libero_max.policies.pieces.images import side_by_side
from pytest_libero_max.policies.pieces.steps import ACTION_STEPS, INPUT_STEPS, TEXT_STEPS, Step, parse_steps
from pytest_libero_max.policies.profile import Profile, load_profile, profile_names
from pytest_libero_max.policies.servers.address import Address, parse_address
from pytest_libero_max.policies.servers.link import Client, Link
from pytest_libero_max.worlds.contract import ACTION_DIM, CAMERAS, Observation

Actions = NDArray[np.float64]

KEYS = (
    "robot0_eef_pos",
    "robot0_eef_quat",
    "robot0_gripper_qpos",
    "robot0_gripper_qvel",
    "robot0_joint_pos",
    "robot0_joint_vel",
)
"""What an input may be made from, beside the images."""


@dataclass(frozen=True)
class Input:
    """One array, text or file that a request holds.

    Attributes:
        source: A key of the observation, or None.
        parts: Other inputs, joined: values one after the other, images side by side.
        steps: What is done to it.
        dtype: Its type, or None to leave it.
        shape: Its shape, or None to leave it.
    """

    source: str | None
    parts: tuple[str, ...]
    steps: tuple[Step, ...]
    dtype: str | None
    shape: tuple[int, ...] | None


class Request:
    """How an observation becomes what a server is sent.

    Args:
        profile: Its tables ``inputs``, ``instruction`` and ``request``.

    Attributes:
        cameras: Whose images it needs.
        seeded: Whether it carries the seed of the query.

    Raises:
        AdapterError: A name or step does not exist.
    """

    def __init__(self, profile: Profile) -> None:
        self._inputs = {name: _input(name, table) for name, table in profile.tables.get("inputs", {}).items()}
        self._text = parse_steps(profile.get("instruction", "steps", []), TEXT_STEPS, "instruction.steps")
        self._layout = profile.tables.get("request", {})
        self._where = f"profile {profile.name!r}"
        known = (*self._inputs, *_QUERY_VALUES)
        for name in _named(self._layout):
            if name not in known:
                raise AdapterError(f"{self._where}: request names ${name}. {did_you_mean(name, known)}")
        for name, item in self._inputs.items():
            for part in item.parts:
                if part not in self._inputs:
                    raise AdapterError(
                        f"{self._where}: inputs.{name} joins {part!r}. {did_you_mean(part, self._inputs)}"
                    )
        self.cameras = self.cameras_of(self._layout)
        self.seeded = "seed" in set(_named(self._layout))

    def cameras_of(self, layout: Any) -> tuple[str, ...]:
        """The cameras whose images a layout needs."""
        needed = {source for name in _named(layout) for source in self._sources(name)}
        return tuple(camera for camera in CAMERAS if f"{camera}_image" in needed)

    def build(
        self, observation: Observation, query: Query, episode: Episode, layout: Any = None
    ) -> dict[str, Any]:
        """The request of a query.

        Args:
            observation: What the world shows.
            query: The query.
            episode: The episode it belongs to.
            layout: Another request than that of the profile, with names of the same inputs.

        Raises:
            AdapterError: An input cannot be made; names it and the step.
        """
        values = {name: value_of(query, episode) for name, value_of in _QUERY_VALUES.items()}
        for step in self._text:
            values["instruction"] = step(values["instruction"])
        layout = self._layout if layout is None else layout
        for name in set(_named(layout)) - values.keys():
            values[name] = self._value(name, observation)
        filled: dict[str, Any] = _fill(layout, values)
        return filled

    def arrays(self, observation: Observation, layout: Any = None) -> dict[str, NDArray[Any]]:
        """Those inputs of a request that are arrays, by name.

        Raises:
            AdapterError: An input cannot be made.
        """
        named = dict.fromkeys(_named(self._layout if layout is None else layout))
        values = {name: self._value(name, observation) for name in named if name in self._inputs}
        return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}

    def _sources(self, name: str) -> set[str]:
        item = self._inputs.get(name)
        if item is None:
            return set()
        own = set() if item.source is None else {item.source}
        return own.union(*(self._sources(part) for part in item.parts if part != name))

    def _value(self, name: str, observation: Observation) -> Any:
        item = self._inputs[name]
        if item.source is not None:
            value: Any = np.array(observation[item.source])
        else:
            value = _joined([self._value(part, observation) for part in item.parts])
        try:
            for step in item.steps:
                value = step(value)
        except AdapterError as error:
            raise AdapterError(f"{self._where}, inputs.{name}: {error}") from None
        if item.dtype is not None:
            value = value.astype(item.dtype)
        return value if item.shape is None else value.reshape(item.shape)


_QUERY_VALUES: Mapping[str, Callable[[Query, Episode], Any]] = {
    "instruction": lambda query, episode: query.instruction,
    "seed": lambda query, episode: query.seed,
    "index": lambda query, episode: query.index,
    "step": lambda query, episode: query.step,
    "suite": lambda query, episode: episode.suite,
    "task_index": lambda query, episode: episode.task_index,
    "episode_instruction": lambda query, episode: episode.instruction,
    "policy_seed": lambda query, episode: episode.seed,
    "max_steps": lambda query, episode: episode.max_steps,
}
"""What a request can name beside the inputs of its profile."""


class Reply:
    """How a server's reply becomes actions.

    Args:
        profile: Its tables ``reply`` and ``actions``.

    Raises:
        AdapterError: A step does not exist, or the statistics cannot be read.
    """

    def __init__(self, profile: Profile) -> None:
        self._at = tuple(profile.get("reply", "at", []))
        self._parts = tuple(profile.get("reply", "parts", []))
        normalised = profile.get("reply", "normalised_at")
        self._normalised_at = None if normalised is None else tuple(normalised)
        self._steps = parse_steps(profile.get("actions", "steps", []), ACTION_STEPS, "actions.steps")
        self._before = parse_steps(
            profile.get("actions", "normalised_steps", []), ACTION_STEPS, "actions.normalised_steps"
        )
        file = profile.get("actions", "statistics")
        self._statistics: Statistics | None = None
        if file is not None:
            rule = profile.get("actions", "statistics_rule", "bounds")
            self._statistics = read_statistics(
                profile.folder / file, profile.get("actions", "statistics_key"), rule
            )
        control = profile.get("actions", "control", "delta")
        if control != "delta":
            raise AdapterError(
                f"Profile {profile.name!r} has control={control!r}: its actions are poses in the world. "
                "Worlds take movements relative to where the hand is, as LIBERO's controller does by "
                "default, so these actions cannot be played exactly yet."
            )

    def read(self, reply: Any, least: int, most: int) -> Actions:
        """The actions of a reply, (n, 7) float64, with ``least`` <= n <= ``most``.

        More than ``most`` are cut to the first ones, which are the next to be executed.

        Raises:
            ServerError: They are not there, of another shape, too few, or not finite.
        """
        found, normalised = self._find(reply)
        actions = _two_axes(found)
        if not np.isfinite(actions).all():
            row, column = (int(i) for i in np.argwhere(~np.isfinite(actions))[0])
            raise ServerError(
                f"the reply has actions[{row}, {column}]={actions[row, column]}, which is not finite"
            )
        try:
            if normalised:
                actions = self._unnormalised(actions)
            for step in self._steps:
                actions = step(actions)
        except AdapterError as error:
            raise ServerError(f"the reply has actions of shape {actions.shape}: {error}") from error
        if actions.ndim != 2 or actions.shape[1] != ACTION_DIM:
            raise ServerError(
                f"the reply has actions of shape {actions.shape}, but must have (n, {ACTION_DIM})"
            )
        if len(actions) < least:
            raise ServerError(
                f"the reply has {len(actions)} action(s), but {least} are executed before the next query; "
                "lower --libero-max-query-interval"
            )
        return actions[:most]

    def _find(self, reply: Any) -> tuple[Any, bool]:
        try:
            found = _at(reply, self._at)
        except KeyError as error:
            if self._normalised_at is None:
                raise ServerError(_missing(reply, self._at, error)) from None
            try:
                return _at(reply, self._normalised_at), True
            except KeyError:
                raise ServerError(_missing(reply, self._at, error)) from None
        if self._parts:
            if not isinstance(found, Mapping) or any(part not in found for part in self._parts):
                raise ServerError(_missing(found, self._parts, None))
            found = _columns([_numbers(found[part]) for part in self._parts])
        return found, False

    def _unnormalised(self, actions: Actions) -> Actions:
        if self._statistics is None:
            raise ServerError(
                "the actions of the reply are normalised, and the profile names no statistics; extend it and "
                "give actions.statistics, the path of the dataset_statistics.json of these weights"
            )
        for step in self._before:
            actions = step(actions)
        return unnormalise(actions, self._statistics)


Adapt = Callable[[Any, PolicySpec], tuple[Any, PolicySpec]]
"""From what a server says about itself, and the spec so far, to the layout of its requests and the spec."""


class ServedPolicy:
    """A policy behind a server, as the pair runner knows policies.

    Args:
        spec: What it declares.
        request: Makes requests.
        reply: Reads replies.
        connect: Makes the client; told whom to tell what the server says about itself.
        adapt: Makes the layout of the request and the spec, of what the server said; None: as they are.

    Attributes:
        greeting: What the server says about itself.
        client: The connection, which counts interruptions.
    """

    def __init__(
        self,
        spec: PolicySpec,
        request: Request,
        reply: Reply,
        connect: Callable[[Callable[[Any], None]], Client],
        adapt: Adapt | None = None,
    ) -> None:
        self.spec = spec
        self.greeting: Any = None
        self._request = request
        self._reply = reply
        self._adapt = adapt
        self._layout: Any = None
        self._episode = Episode("", 0, "", 0, 1)
        self.client = connect(self._greeted)

    @property
    def waited_s(self) -> float:
        """How long the server was waited for after interruptions, s."""
        return self.client.waited_s

    def reset(self, episode: Episode) -> None:
        """Keep the episode for the requests; servers are asked query by query and have nothing to forget."""
        self._episode = episode

    def predict(self, observation: Observation, query: Query) -> Actions:
        """Ask the server.

        Raises:
            ServerError: It was given up.
        """
        request = self._request.build(observation, query, self._episode, self._layout)
        spec = self.spec
        return self.client.ask(
            request, lambda reply: self._reply.read(reply, spec.query_interval, spec.horizon)
        )

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, NDArray[Any]]:
        """The arrays of the request, by the names that the profile gives them, for a look at them.

        Raises:
            AdapterError: An input cannot be made.
        """
        return self._request.arrays(observation, self._layout)

    def _greeted(self, greeting: Any) -> None:
        _require_chunk(greeting, self.spec)
        if self._adapt is not None:
            layout, spec = self._adapt(greeting, self.spec)
            if self.greeting is None:
                self._layout, self.spec = layout, spec
            elif (layout, spec) != (self._layout, self.spec):
                raise ServerError(
                    "the server declares or wants something else than before; is it the same one?"
                )
        self.greeting = {} if greeting is None else greeting


def _require_chunk(greeting: Any, spec: PolicySpec) -> None:
    """Refuse a Q beyond the chunk that a server says it returns."""
    size = greeting.get("action_chunk_size") if isinstance(greeting, Mapping) else None
    if isinstance(size, int) and size < spec.query_interval:
        raise AdapterError(
            f"The server returns {size} actions (action_chunk_size), but "
            f"query_interval={spec.query_interval} "
            "are executed before the next query. Lower --libero-max-query-interval."
        )


def load_served(
    text: str, profile_text: str | None, horizon: int | None = None, query_interval: int | None = None
) -> ServedPolicy:
    """The policy at an address, connected.

    Args:
        text: The address.
        profile_text: Name or path of the profile.
        horizon: Replaces H of the profile.
        query_interval: Replaces Q of the profile.

    Raises:
        AdapterError: The address or the profile cannot be used.
        ServerError: The server was given up.
    """
    address, profile = parse_address(text), require_profile(text, profile_text)
    given = {"policy.horizon": horizon, "policy.query_interval": query_interval}
    profile.require_known(tuple(name for name, value in given.items() if value is not None))
    request, reply = Request(profile), Reply(profile)
    spec = PolicySpec(
        name=profile.get("policy", "name"),
        horizon=profile.get("policy", "horizon", query_interval or 1) if horizon is None else horizon,
        query_interval=profile.get("policy", "query_interval", 1)
        if query_interval is None
        else query_interval,
        cameras=request.cameras,
        image_size=profile.get("policy", "image_size", 256),
        repeatable=profile.get("policy", "repeatable", False),
        suites=profile.get("policy", "suites"),
        revision=profile.get("policy", "revision") or f"profile {profile.name} {profile.digest[:12]}",
    )
    link, adapt = _link(address, profile, spec, request)
    if profile.get("policy", "declared_by_server", False):
        adapt = _as_declared(profile, request, horizon, query_interval)
    policy = ServedPolicy(
        spec,
        request,
        reply,
        lambda told: Client(f"policy server {address}", link, address.patience_s, told),
        adapt,
    )
    policy.client.connect()
    return policy


def _as_declared(
    profile: Profile, request: Request, horizon: int | None, query_interval: int | None
) -> Adapt:
    """Takes the spec from the server, and sends the images that it asks for."""
    from pytest_libero_max.policies.servers.host import declared_spec

    layout = profile.tables["request"]

    def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
        declared = declared_spec(greeting)
        declared = replace(
            declared,
            horizon=declared.horizon if horizon is None else horizon,
            query_interval=declared.query_interval if query_interval is None else query_interval,
        )
        unseen = {f"{camera}_image" for camera in request.cameras if camera not in declared.cameras}
        seen = {key: value for key, value in layout["observation"].items() if key not in unseen}
        return {**layout, "observation": seen}, declared

    return adapt


def require_profile(text: str, profile_text: str | None) -> Profile:
    """The profile for an address.

    Raises:
        AdapterError: None is named, there is none of that name, or it is for another protocol.
    """
    address = parse_address(text)
    if profile_text is None:
        raise AdapterError(
            f"policy={text!r} is the address of a server, and how it is asked depends on the policy behind "
            f"it. Add --libero-max-profile=NAME; for {address.scheme}:// there are {_fitting(address)}, or "
            "the path of your own."
        )
    profile = load_profile(profile_text)
    if profile.protocol != address.protocol:
        raise AdapterError(
            f"profile={profile_text!r} is for {profile.protocol}://, but the address is {str(address)!r}. "
            f"For {address.scheme}:// there are {_fitting(address)}."
        )
    return profile


def _fitting(address: Address) -> str:
    """The profiles of this package for an address, for messages."""
    return ", ".join(name for name in profile_names() if load_profile(name).protocol == address.protocol)


def _link(
    address: Address, profile: Profile, spec: PolicySpec, request: Request
) -> tuple[Link, Adapt | None]:
    """The connection in the protocol of the address, and what the server's greeting changes."""
    match address.protocol:
        case "openpi":
            from pytest_libero_max.policies.servers.openpi import OpenpiLink

            return OpenpiLink(address), None
        case "starvla":
            from pytest_libero_max.policies.servers.starvla import StarvlaLink

            return StarvlaLink(address), None
        case "vla-eval":
            from pytest_libero_max.policies.servers.vla_eval import VlaEvalLink, wanted

            def adapt(greeting: Any, spec: PolicySpec) -> tuple[Any, PolicySpec]:
                layout = wanted(profile.tables.get("request", {}), greeting)
                return layout, replace(spec, cameras=request.cameras_of(layout))

            return VlaEvalLink(address, spec.query_interval), adapt
        case "http":
            from pytest_libero_max.policies.servers.http_act import CODECS, HttpLink

            codec = _one_of(profile, "codec", CODECS)
            return HttpLink(address, profile.get("policy", "path", "/act"), codec), None
        case _:
            from pytest_libero_max.policies.servers.gr00t import DIALECTS, Gr00tLink

            return Gr00tLink(address, _one_of(profile, "dialect", DIALECTS)), None


def _one_of(profile: Profile, field: str, known: Mapping[str, Any]) -> str:
    value = profile.get("policy", field)
    if value not in known:
        raise AdapterError(
            f"profile {profile.name!r}: policy.{field}={value!r}. {did_you_mean(str(value), known)}"
        )
    return str(value)


def _input(name: str, table: Any) -> Input:
    where = f"inputs.{name}"
    known = ("from", "join", "steps", "dtype", "shape")
    if not isinstance(table, dict) or ("from" in table) == ("join" in table):
        raise AdapterError(f"{where}={table!r}, but must be a table with either 'from' or 'join'.")
    for field in table:
        if field not in known:
            raise AdapterError(f"{where}.{field} is unknown. {did_you_mean(field, known)}")
    sources = (*(f"{camera}_image" for camera in CAMERAS), *KEYS)
    source = table.get("from")
    if source is not None and source not in sources:
        raise AdapterError(f"{where}.from={source!r}. {did_you_mean(str(source), sources)}")
    steps = parse_steps(table.get("steps", []), INPUT_STEPS, f"{where}.steps")
    shape = table.get("shape")
    return Input(
        source,
        tuple(table.get("join", ())),
        steps,
        table.get("dtype"),
        None if shape is None else tuple(shape),
    )


def _named(layout: Any) -> list[str]:
    """The names that a layout refers to with a dollar, in order."""
    if isinstance(layout, Mapping):
        return [name for value in layout.values() for name in _named(value)]
    if isinstance(layout, list):
        return [name for value in layout for name in _named(value)]
    return [layout[1:]] if isinstance(layout, str) and layout[:1] == "$" else []


def _fill(layout: Any, values: Mapping[str, Any]) -> Any:
    if isinstance(layout, Mapping):
        return {key: _fill(value, values) for key, value in layout.items()}
    if isinstance(layout, list):
        return [_fill(value, values) for value in layout]
    if isinstance(layout, str) and layout[:1] == "$":
        return values[layout[1:]]
    return layout


def _joined(values: list[Any]) -> Any:
    if values[0].ndim == 3:
        return side_by_side(*values)
    return np.concatenate(values)


def _at(value: Any, path: tuple[str, ...]) -> Any:
    for key in path:
        if not isinstance(value, Mapping) or key not in value:
            raise KeyError(key)
        value = value[key]
    return value


def _missing(value: Any, path: tuple[str, ...], error: KeyError | None) -> str:
    keys = (
        f"the keys {sorted(map(str, value))}" if isinstance(value, Mapping) else f"a {type(value).__name__}"
    )
    what = "/".join(path) if error is None else f"{'/'.join(path)} (no {error.args[0]!r})"
    return f"the reply has {keys}, but the profile takes the actions from {what}"


def _numbers(value: Any) -> Actions:
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ServerError(f"the actions of the reply are no array ({error})") from None
    if array.dtype.kind not in "fiu":
        raise ServerError(f"the actions of the reply are {array.dtype} {array.shape}, but must be numbers")
    return array.astype(np.float64)


def _two_axes(value: Any) -> Actions:
    """(n, d), without leading axes of length 1."""
    array = _numbers(value)
    while array.ndim > 2 and array.shape[0] == 1:
        array = array[0]
    if array.ndim == 1:
        array = array.reshape(1, -1)
    if array.ndim != 2 or not len(array):
        raise ServerError(f"the reply has actions of shape {array.shape}, but must have (n, d)")
    return array


def _columns(parts: list[Actions]) -> Actions:
    """One array of several that hold a column or two each: (B, n, k) or (B, n) or (n,)."""
    columns = [
        part[0]
        if part.ndim == 3 and len(part) == 1
        else part.T
        if part.ndim == 2 and len(part) == 1
        else part
        for part in parts
    ]
    columns = [part.reshape(-1, 1) if part.ndim == 1 else part for part in columns]
    if any(part.ndim != 2 or len(part) != len(columns[0]) for part in columns):
        raise ServerError(
            f"the parts of the actions have shapes {', '.join(str(part.shape) for part in parts)}"
        )
    return np.concatenate(columns, axis=1)
