from __future__ import annotations

import re
from pathlib import Path

import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies import profile as profiles
from pytest_libero_max.policies.adapter_digest import adapter_digest
from pytest_libero_max.policies.loading import check_reference, load_policy
from pytest_libero_max.policies.profile import UNKNOWN, leaves, load_profile, profile_names

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", profile_names())
def test_every_field_says_where_its_value_was_read(name: str) -> None:
    profile = load_profile(name)
    sources = profile.tables["sources"]
    assert all(isinstance(text, str) and len(text) > 5 for text in sources.values())
    for section, table in profile.tables.items():
        if section == "sources":
            continue
        for field, _ in leaves(table, section):
            assert any(field == source or field.startswith(f"{source}.") for source in sources), field
    for source in sources:
        section, _, field = source.partition(".")
        assert profile.get(section, field) is not None if field else section in profile.tables, source


@pytest.mark.parametrize("name", profile_names())
def test_numbers_are_numbers_or_not_established(name: str) -> None:
    profile = load_profile(name)
    if profile.get("policy", "declared_by_server"):
        return
    horizon, interval = profile.get("policy", "horizon"), profile.get("policy", "query_interval")
    for value in (horizon, interval):
        assert value == UNKNOWN or (isinstance(value, int) and value >= 1)
    if UNKNOWN not in (horizon, interval):
        assert interval <= horizon


def write(folder: Path, text: str, name: str = "mine.toml") -> str:
    path = folder / name
    path.write_text(text)
    return str(path)


def test_statistics_lie_beside_the_profile_that_names_them(tmp_path: Path) -> None:
    weights = tmp_path / "weights"
    weights.mkdir()
    own = 'extends = "vla_jepa"\n[actions]\nstatistics = "statistics.json"\n'
    write(weights, own)
    deeper = load_profile(
        write(tmp_path, 'extends = "weights/mine.toml"\n[policy]\nhorizon = 4\n', "deeper.toml")
    )
    assert (deeper.name, deeper.folder) == ("deeper", weights)
    assert load_profile(write(tmp_path, own)).folder == tmp_path


def test_a_field_that_is_not_established_is_refused_until_it_is_given(tmp_path: Path) -> None:
    with pytest.raises(AdapterError, match=r"policy\.horizon, policy\.query_interval.*--libero-max-horizon"):
        load_policy("vla-eval://127.0.0.1:1", profile="vla_eval")
    with pytest.raises(AdapterError, match=r"not know actions\.statistics"):
        load_policy("starvla://127.0.0.1:1", profile="vla_jepa")
    load_profile("vla_eval").require_known(("policy.horizon", "policy.query_interval"))
    mine = load_profile(write(tmp_path, 'extends = "vla_eval"\n[policy]\nhorizon = 8\nquery_interval = 4\n'))
    mine.require_known()
    assert mine.get("policy", "name") == "vla-eval"


def test_a_profile_of_ones_own_replaces_what_it_names_and_files_lie_beside_it(tmp_path: Path) -> None:
    base = write(tmp_path, 'extends = "pi05_libero"\n[policy]\nquery_interval = 10\n', "base.toml")
    own = '[request]\nprompt = "$instruction"\n[actions]\nstatistics = "own.json"\n'
    mine = load_profile(write(tmp_path, f'extends = "base.toml"\n{own}'))
    assert mine.get("policy", "query_interval") == 10
    assert mine.tables["request"] == {"prompt": "$instruction"}
    assert mine.folder == Path(base).parent
    assert mine.tables["inputs"] == load_profile("pi05_libero").tables["inputs"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[policy", "cannot be read"),
        ('[polcy]\nname = "x"', "Did you mean 'policy'"),
        ('extends = "pi05_libero"\n[policy]\nhorizn = 3', "Did you mean 'horizon'"),
        ('[policy]\nname = "x"', r"lacks policy\.protocol"),
        ("extends = 4", "must be the name of a profile"),
        ('extends = "mine.toml"', "extends itself"),
        ('extends = "pi05_librero"', "Did you mean 'pi05_libero'"),
        ('extends = "other.toml"', "no such profile. Check the path"),
        ("x = " + "[" * 9999, "cannot be read"),
        (
            '[policy]\nhorizon = "ten"',
            r"mine\.toml: policy\.horizon='ten', but must be an integer of at least 1",
        ),
        ("[policy]\nimage_size = [0, 8]", r"policy\.image_size=\[0, 8\], but must be an integer .*, or two"),
        ('[policy]\nrepeatable = "yes"', "policy.repeatable='yes', but must be true or false"),
        ('[policy]\nsuites = "libero_goal"', "policy.suites='libero_goal', but must be a list of texts"),
        ('[reply]\nat = "actions"', "reply.at='actions', but must be a list"),
        ("[native.budgets]\nlibero_goal = -1", "native.budgets=.*, but must be a table of integers"),
    ],
)
def test_a_damaged_profile_is_refused_with_the_reason(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(AdapterError, match=message):
        load_profile(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[request]\nprompt = "$instrution"', r"Did you mean 'instruction'"),
        (
            '[inputs.image]\nfrom = "agentview"',
            r"inputs\.image\.from='agentview'. Did you mean 'agentview_image'",
        ),
        ('[inputs.image]\nfrm = "x"', "either 'from' or 'join'"),
        ('[inputs.image]\nfrom = "agentview_image"\nstep = []', r"inputs\.image\.step is unknown"),
        ('[inputs.image]\nfrom = "agentview_image"\nsteps = ["rotate"]', "Did you mean 'rotate_180'"),
        ('[inputs.state]\njoin = ["positon"]', "Did you mean 'position'"),
        ("[inputs.state]\njoin = [7]", "joins 7"),
        ('[instruction]\nsteps = ["upper"]', "no step"),
        ('[actions]\nsteps = ["gripper"]', "no step"),
        ('[actions]\nstatistics = "none.json"', "cannot be read"),
        ('[actions]\ncontrol = "joints"', "control='joints'"),
    ],
)
def test_a_profile_that_asks_for_what_there_is_not_is_refused_before_connecting(
    text: str, message: str, tmp_path: Path
) -> None:
    path = write(tmp_path, f'extends = "pi05_libero"\n{text}\n')
    with pytest.raises(AdapterError, match=message):
        load_policy("openpi://127.0.0.1:1?patience=0.1", profile=path)


def test_an_address_needs_a_profile_of_its_protocol_and_nothing_else_takes_one() -> None:
    with pytest.raises(AdapterError, match=r"--libero-max-profile=NAME; .*openpi://.*pi05_libero"):
        check_reference("openpi://gpu:8000")
    with pytest.raises(AdapterError, match=r"'pi05_libero' is for openpi://.*vla-eval://"):
        check_reference("vla-eval://gpu:8000", "pi05_libero")
    with pytest.raises(AdapterError, match="Did you mean 'pi05_libero'"):
        check_reference("openpi://gpu:8000", "pi5_libero")
    with pytest.raises(AdapterError, match="no such profile"):  # too long for the name of a file
        check_reference("openpi://gpu:8000", "9" * 5000)
    with pytest.raises(AdapterError, match="Leave --libero-max-profile out"):
        check_reference("expert", "pi05_libero")
    with pytest.raises(AdapterError, match="Leave --libero-max-profile out"):
        load_policy("expert", profile="pi05_libero")
    check_reference("openpi://gpu:8000", "pi05_libero")


def test_the_digest_is_that_of_what_is_asked_and_not_of_where(tmp_path: Path) -> None:
    first = adapter_digest("openpi://gpu:8000", "pi05_libero")
    assert first == adapter_digest("openpi://other:1", "pi05_libero")
    same = write(tmp_path, 'extends = "pi05_libero"\n[sources]\nrequest = "read again"\n')
    assert adapter_digest("openpi://gpu:8000", same) == first
    other = write(tmp_path, 'extends = "pi05_libero"\n[policy]\nimage_size = 128\n')
    assert adapter_digest("openpi://gpu:8000", other) != first


def test_the_page_lists_every_profile_with_its_protocol() -> None:
    page = (ROOT / "docs" / "how-to" / "served-models.md").read_text(encoding="utf-8")
    listed = {
        name: scheme
        for scheme, name in re.findall(r"\| `([a-z0-9-]+)://` \| (?:\*\*)?`(\w+)`(?:\*\*)? \|", page)
    }
    assert listed == {name: load_profile(name).protocol for name in profile_names()}


_BLOCK = re.compile(
    r"^```sh\n((?:.*\n)*?)libero-max check (\w[\w-]*)://\S+ --profile (\S+)(.*)\n(.*)\n```", re.M
)


def test_each_model_has_a_block_whose_server_and_profile_belong_together() -> None:
    page = (ROOT / "docs" / "how-to" / "served-models.md").read_text(encoding="utf-8")
    section = page.split("## Model by model\n")[1].split("\n## ")[0]
    blocks = _BLOCK.findall(section)
    assert len(blocks) == section.count("```sh") == 11
    for server, scheme, name, options, play in blocks:
        profile = load_profile("vla_jepa" if name == "my_vla_jepa.toml" else name)
        assert profile.protocol == scheme
        told = [f"--libero-max-profile={name}", *(f"--libero-max-{o}" for o in options.split(" --")[1:])]
        assert all(part.replace(" ", "=") in play for part in told), (name, play)
        about = (profiles.FOLDER / f"{profile.name.removesuffix('_goal')}.toml").read_text(encoding="utf-8")
        comment = about.split("\n\n")[0].splitlines()
        started = [line[4:].removesuffix("\\").split() for line in comment if line.startswith("#   ")]
        missing = [
            words for words in started if "=" not in words and any(word not in server for word in words)
        ]
        assert missing in ([], [["[actions]"]]), name


def test_a_profile_whose_server_declares_itself_needs_a_request_as_well(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text('[policy]\nname = "x"\nprotocol = "openpi"\ndeclared_by_server = true\n')
    with pytest.raises(AdapterError, match=r"lacks a \[request\]"):
        load_policy("openpi://127.0.0.1:1", profile=str(own))
