"""The command line as a person meets it: quick help, one sentence per failure, clean output."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.written_numbers import measured
from impactd.console.tables import table
from impactd.settings.settings import find_config

CONFIG = find_config("simulated.toml")
COMMANDS = """
serve make-safe demo bench doctor status drop abort calibrate shots moduli fit diagnose effects
new import export verify reindex refit token sign-in-code
""".strip().split()


def run(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("IMPACTD_")}
    return subprocess.run(
        [sys.executable, "-m", "impactd", *map(str, words)],
        env=clean | environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def failed(result: subprocess.CompletedProcess[str]) -> str:
    """Return the sentence of a command that failed as it should."""
    assert result.returncode == 1, result
    assert result.stderr.count("\n") == 1, result.stderr
    assert "Traceback" not in result.stderr
    return result.stderr


def test_every_command_explains_itself_without_loading_anything_heavy():
    """`--help` answers from names and options alone: no numpy, no web framework is imported."""
    commands = ["", *COMMANDS, "token create", "token list", "token revoke"]
    commands += ["certificate write", "certificate read"]
    code = (
        "import sys; from impactd.cli import app\n"
        "for command in sys.argv[1:]:\n"
        "    try: app([*command.split(), '--help'], prog_name='impactd')\n"
        "    except SystemExit as end: assert not end.code, (command, end.code)\n"
        "heavy = {'numpy', 'numba', 'scipy', 'h5py', 'fastapi', 'httpx2', 'uvicorn'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *commands], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("Usage: impactd") == len(commands)


def test_wrong_usage_ends_with_2():
    """A word too few, too many or unknown is wrong usage."""
    assert run("drop", "acetal").returncode == 2
    assert run("frobnicate").returncode == 2
    assert run("token", "create", "--scope", "root").returncode == 2


def test_numbers_that_are_none_are_wrong_usage(tmp_path):
    """`nan` and a scale of 0 are answered before anything is asked of a rig or a file."""
    assert "the drop height is nan" in run("drop", "acetal", "specimen", "nan").stderr
    hot = run("drop", "acetal", "specimen", "0.04", "--temperature", "inf")
    assert (hot.returncode, "--temperature is inf" in hot.stderr) == (2, True)
    scaled = run("new", tmp_path / "a.csv", "--scale", "0")
    assert (scaled.returncode, "leaves nothing" in scaled.stderr) == (2, True)


def test_a_token_for_longer_than_the_calendar_is_one_sentence(tmp_path):
    """Nobody needs it, and the way to one without an end is told."""
    words = ("token", "create", "--scope", "read", "--days", "1e300")
    assert "36525 days" in failed(run(*words, "--config", CONFIG, "--data", tmp_path))


def test_no_daemon_is_one_sentence():
    """A client without a daemon says where it looked and what to do."""
    said = failed(run("status", "--url", "http://127.0.0.1:9"))
    assert "http://127.0.0.1:9" in said
    assert "impactd serve" in said


def test_a_wrong_settings_file_is_one_sentence(tmp_path):
    """A missing file is named."""
    said = failed(run("serve", "--config", tmp_path / "none.toml"))
    assert "none.toml" in said


def test_a_token_is_printed_once_and_alone(tmp_path):
    """`token create` prints the secret and nothing else; the list never shows it."""
    where = ("--config", CONFIG, "--data", tmp_path)
    made = run("token", "create", "--scope", "operate", "--name", "bench", "--days", "1", *where)
    assert made.returncode == 0, made.stderr
    secret = made.stdout.strip()
    assert len(secret.split()) == 1
    listed = run("token", "list", "--json", *where)
    assert secret not in listed.stdout
    (token,) = json.loads(listed.stdout)
    assert (token["name"], token["scope"], token["revoked_utc"]) == ("bench", "operate", None)
    assert run("token", "revoke", token["id"], *where).returncode == 0
    assert json.loads(run("token", "list", "--json", *where).stdout)[0]["revoked_utc"]
    assert "no token 99" in failed(run("token", "revoke", 99, *where))


def test_a_diagnosis_of_no_campaign_is_one_sentence(tmp_path):
    """A folder that is not there is named; an unknown base is wrong usage."""
    assert "campaign.json" in failed(run("diagnose", tmp_path / "campaign.json"))
    assert run("diagnose", tmp_path / "campaign.json", "--base", "none").returncode == 2


def test_effects_can_be_listed():
    """Every effect comes with source, validation and described numbers; people get a table."""
    found = {effect["id"]: effect for effect in json.loads(run("effects", "--json").stdout)}
    constant = found["coupler_highpass"]["parameters"][0]
    assert (constant["name"], constant["unit"]) == ("time_constant_s", "s")
    assert constant["low"] < constant["high"]
    assert all(effect["source"] and effect["validation"] for effect in found.values())
    assert "coupler_highpass " in run("effects").stdout


def test_a_missing_campaign_is_one_sentence(tmp_path):
    """A fit of a folder that is not there names it."""
    assert "campaign.json" in failed(run("fit", tmp_path / "campaign.json"))


def test_a_failure_nobody_foresaw_is_one_sentence_too(tmp_path):
    """Even a bug is one sentence, with a way to see more."""
    said = failed(run("fit", tmp_path / "x.json", "--model", "\udcff"))
    assert said.startswith("impactd:")


def test_doctor_finds_what_is_missing_and_says_how_to_mend_it(tmp_path):
    """On a fresh simulated rig only a token is missing; with one, all is well."""
    where = ("--config", CONFIG, "--data", tmp_path)
    first = run("doctor", "--json", *where)
    assert first.returncode == 1
    bad = [finding for finding in json.loads(first.stdout) if not finding["well"]]
    assert [finding["name"] for finding in bad] == ["tokens"]
    assert "impactd token create" in bad[0]["mend"]
    run("token", "create", "--scope", "operate", *where)
    second = run("doctor", *where)
    assert second.returncode == 0, second.stdout + second.stderr
    assert "digitizer: answers" in second.stdout


def test_a_height_in_millimetres_is_answered_in_metres(tmp_path):
    """Before anything is asked of the rig."""
    said = run("drop", "acetal", "specimen", "45").stderr
    assert "in metres" in said
    assert "0.045" in said


@pytest.mark.parametrize("height", ["-0.045", "45mm", "0.045m"])
def test_a_height_below_zero_or_with_a_unit_is_answered_with_what_to_type(height):
    """It is neither an unknown option nor just no number."""
    answer = run("drop", "acetal", "specimen", height)
    assert answer.returncode == 2
    assert f"{height!r} must be a number above 0, in metres" in " ".join(answer.stderr.split())


def test_a_table_aligns_words_left_and_numbers_right():
    """Columns stay readable in a pipe."""
    assert table(("name", "n"), [("a", 1), ("bcd", 20)]) == "name   n\n----  --\na      1\nbcd   20"


@pytest.mark.parametrize(
    ("quantity", "said"),
    [
        ({"value": 3.1415e9, "u": 2.0e7}, "3.142 +- 0.039"),
        ({"value": 3.0, "u": 0.1, "expanded": {"U": 0.21}}, "3.00 +- 0.21"),
        ({"value": 7.13526e-4, "u": 3.6e-6}, "0.0007135 +- 0.0000071"),
        ({"value": 1.25e-10, "u": 1.0e-11}, "(1.25 +- 0.20)e-10"),
        ({"value": -4.2e3, "u": 1.0e12}, "(-0.0 +- 2.0)e+12"),
        ({"value": 5.0, "u": 0.0}, "5"),
        ({"value": None, "u": 1.0}, "-"),
        (None, "-"),
    ],
)
def test_a_quantity_shows_two_digits_of_its_uncertainty(quantity, said):
    """Value and uncertainty end at the same digit."""
    scale = 1e-9 if quantity and quantity["value"] and quantity["value"] > 1e6 else 1.0
    assert measured(quantity, scale=scale) == said


def test_export_refuses_an_unknown_shot(tmp_path):
    """A shot that is not there is named."""
    where = ("--config", CONFIG, "--data", tmp_path / "data")
    run("token", "create", "--scope", "read", *where)
    told = failed(run("export", 7, "--out", tmp_path / "out", *where))
    assert "no shot 7. `impactd shots`" in told


def test_python_m_impactd_and_the_console_script_are_the_same():
    """Both print the version."""
    script = Path(sys.executable).with_name("impactd")
    said = subprocess.run([script, "--version"], capture_output=True, text=True, check=True).stdout
    assert said == run("--version").stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("schema", "foo"), "'foo' is not one of 'campaign', 'fit'"),
        (("shots", "abc"), "'abc' cannot be taken; it must be a whole number."),
        (("shots", "--limit", "0"), "'0' cannot be taken; it must be greater than or equal to 1."),
        (("diagnose", "x", "--report", "/none/x.html"), "there is no folder /none. Make it"),
        (("diagnose", "x", "--report", "x.pdf"), "x.pdf must end in .html."),
        (("fit", "x", "--csv", "/"), "/ is a folder; name a file in it."),
        (("plot", "9", "--out", "x.docx"), "x.docx must end in .pdf or .svg or .png."),
        (("budget", "9"), "`impactd moduli --budget` has that of stored shots"),
    ],
)
def test_a_wrong_argument_is_told_before_anything_runs(words, said):
    """In plain words, with what would be right."""
    result = run(*words)
    assert result.returncode == 2, result
    assert said in result.stderr
    for foreign in ("Value error", "Input should", "Traceback"):
        assert foreign not in result.stderr


def test_what_reads_an_archive_begins_none(tmp_path):
    """A wrong folder is told; nothing is made there."""
    there = tmp_path / "elsewhere"
    for words in (("verify",), ("export", 9)):
        told = failed(run(*words, "--config", CONFIG, "--data", there))
        assert f"{there} holds no archive. Give --data" in told
    assert not there.exists()


def test_an_effect_that_the_simulator_lacks_is_told_before_the_demo_begins(tmp_path):
    """With those that it knows; an earlier demo stays."""
    told = failed(run("demo", "--effect", "foo", "--out", tmp_path / "demo"))
    assert "no effect 'foo'; it knows none, random, adhesion" in told
    assert not (tmp_path / "demo").exists()


def test_a_refit_with_a_model_that_nobody_knows_writes_no_fit(tmp_path):
    """It says which there are."""
    words = ("refit", "--model", "foo", "--config", CONFIG, "--data", tmp_path / "data")
    assert "no base model 'foo'; known are hsd, kv, kv2" in failed(run(*words))
