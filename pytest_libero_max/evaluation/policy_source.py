"""Where the policy of a run comes from: a reference that is loaded, or an object that the program has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.documents import Json, known
from pytest_libero_max.errors import AdapterError, class_name
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.runs.plan import OBJECT

if TYPE_CHECKING:
    from pytest_libero_max.policies.clients.servers import Servers
    from pytest_libero_max.policies.contract import Policy


class PolicySource:
    """A policy that a reference names: loaded by each process that plays, and known by its code and files."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.servers: Servers | None = None

    @property
    def names_files(self) -> bool:
        """True if the files that loading it reads belong to its identity."""
        from pytest_libero_max.policies.adapter_digest import names_its_files

        return names_its_files(self.settings.reference)

    def check(self) -> None:
        """Check the reference, and read the list of its servers, without loading anything.

        Raises:
            AdapterError: It leads nowhere.
        """
        from pytest_libero_max.policies.clients.servers import read_servers
        from pytest_libero_max.policies.loading import check_reference

        settings = self.settings
        check_reference(settings.reference, settings.profile, settings.revision)
        check_policies_of_arms(settings, settings.reference)
        if is_served(settings.reference):
            self.servers = read_servers(settings.reference, settings.profile, settings.revision).resolved()

    @property
    def several_servers(self) -> Servers | None:
        """Its servers; None for a single one that answers all pairs, and for other policies."""
        served = self.servers
        return served if served and (len(served.addresses) > 1 or served.groups[0].marks) else None

    @property
    def published_row(self) -> str | None:
        """Row of the paper that the profiles of its servers name; None without one, or for several."""
        groups = () if self.servers is None else self.servers.groups
        rows: set[str | None] = {group.profile.get("published", "row") for group in groups}
        return rows.pop() if len(rows) == 1 else None

    def identity(self) -> str:
        """Return what tells it from another policy, see :mod:`pytest_libero_max.policies.adapter_digest`."""
        from pytest_libero_max.policies.adapter_digest import adapter_digest

        settings = self.settings
        return adapter_digest(settings.reference, settings.profile, settings.revision)

    def load(self, seat: int, run_begun_s: float | None) -> Policy:
        """Return the policy, as the settings wrap it."""
        from pytest_libero_max.policies.adapter_digest import files_read
        from pytest_libero_max.policies.check import ends_the_session
        from pytest_libero_max.policies.clients.waiting import note_in
        from pytest_libero_max.policies.loading import load_policy

        settings = self.settings
        note_in(settings.output)
        try:
            with files_read(settings.reference, run_begun_s):
                policy = load_policy(
                    settings.reference,
                    horizon=settings.horizon,
                    query_interval=settings.query_interval,
                    profile=settings.profile,
                    revision=settings.revision,
                    seat=seat,
                )
            return wrapped(policy, settings)
        except BaseException as error:
            if isinstance(error, Exception) or ends_the_session(error):
                raise
            # Whoever keeps the policy for later pairs keeps no such exception with it.
            raise AdapterError(
                f"policy {settings.policy!r} raised {class_name(error)} while it was loaded: {error}. Repair "
                "the adapter."
            ) from error

    def release(self, policy: Policy) -> None:
        """Close a policy that :meth:`load` has returned, and leave nothing of it in this process."""
        from pytest_libero_max.policies.loading import forget_adapter

        close_policy(policy)
        forget_adapter()

    def spec(self) -> Json | None:
        """Return the policy's spec as it will be played, where that is known before it is loaded."""
        return None

    def provenance(self) -> Json:
        """Return the policy as it was asked for."""
        several = self.several_servers
        return {
            "reference": self.settings.reference,
            "code": self.identity(),
            **self.settings.recorded("policy"),
            **known(servers=None if several is None else several.to_list(), published=self.published_row),
        }


class GivenPolicy(PolicySource):
    """A policy object of the program, or a class or function without arguments that makes one.

    No later process can load it, so its records name it and not its code; ``PolicySpec(revision=...)`` says
    which weights it has.
    """

    def __init__(self, settings: Settings, thing: Any) -> None:
        super().__init__(settings)
        self.thing = thing

    names_files = False

    @property
    def is_made(self) -> bool:
        """True if the run makes the policy, and closes it."""
        return isinstance(self.thing, type) or not hasattr(self.thing, "predict")

    def check(self) -> None:
        """Check that it can be a policy, or raise AdapterError."""
        if self.is_made and not callable(self.thing):
            raise AdapterError(
                f"policy={self.thing!r} is no policy. Give an object with spec, reset and predict, a class "
                "or function that returns one, or what --libero-max-policy takes: a name, file or address."
            )
        check_policies_of_arms(self.settings)

    def identity(self) -> str:
        return OBJECT

    def spec(self) -> Json | None:
        from pytest_libero_max.policies.check import memory_of
        from pytest_libero_max.policies.contract import PolicySpec

        settings, spec = self.settings, getattr(self.thing, "spec", None)
        if self.is_made or settings.wrap or not isinstance(spec, PolicySpec):
            return None
        memory = memory_of(self.thing)
        return spec.to_dict() | known(
            horizon=settings.horizon,
            query_interval=settings.query_interval,
            memory=None if memory == "none" else memory,
        )

    def load(self, seat: int, run_begun_s: float | None) -> Policy:
        """Return the policy; one that was given has its spec back in :meth:`release`."""
        from pytest_libero_max.policies.check import check_policy
        from pytest_libero_max.policies.loading import override

        settings = self.settings
        policy = check_policy(self.thing() if self.is_made else self.thing, settings.reference)
        self._policy, self._spec = policy, policy.spec
        override(policy, settings.horizon, settings.query_interval)
        return wrapped(policy, settings)

    def release(self, policy: Policy) -> None:
        if self.is_made:
            close_policy(policy)
        elif self._policy.spec is not self._spec:
            self._policy.spec = self._spec


def check_policies_of_arms(settings: Settings, *references: str) -> None:
    """Check the policies that arms of the study name, without loading anything.

    Args:
        references: Of the other policies that play in the same processes.

    Raises:
        AdapterError: One is not installed or leads nowhere, or two adapters have helpers of one name.
    """
    from pytest_libero_max.policies.adapter_digest import require_separate_helpers
    from pytest_libero_max.policies.loading import check_reference
    from pytest_libero_max.policies.references import require_installed

    named = {} if settings.study is None else settings.study.policies
    for name, reference in named.items():
        if reference is None:
            require_installed(name)
        else:
            check_reference(reference)
    if named:
        require_separate_helpers([*references, *filter(None, named.values())])


def wrapped(policy: Policy, settings: Settings) -> Policy:
    """Return a policy behind the wrappers that the settings ask for, which alone the run names.

    Raises:
        AdapterError: It has one that is installed already, or a wrapper does not say in the spec what it is.
    """
    from pytest_libero_max.policies.wrappers import WRAPPERS, setting_of

    for words in policy.spec.wrappers:
        name, mode = setting_of(words)
        if name in WRAPPERS:
            raise AdapterError.seen(
                "wrappers",
                words,
                f" of policy {policy.spec.name!r} is put on by the policy itself, where the run cannot name "
                f"it. Take it off there, and give --libero-max-wrap={name}:{mode}.",
            )
    for name, mode in settings.wrap.items():
        policy = WRAPPERS[name](policy, mode)
        if [setting_of(words) for words in policy.spec.wrappers[-1:]] != [(name, mode)]:
            raise AdapterError.seen(
                "wrappers",
                policy.spec.wrappers,
                f", but the last one has to begin with {name}={mode}. Let the wrapper call "
                f'super().__init__(policy, "{name}={mode}"), with more words behind it if it likes.',
            )
    return policy


def close_policy(policy: Policy) -> None:
    """Close a policy, if it can be closed."""
    close = getattr(policy, "close", None)
    if callable(close):
        close()
